"""The coolant over a stage in which its thermostat opens or closes: exact, with derivatives."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.parameters import Thermal

Floats = NDArray[np.float64]


def radiator_w_per_k(thermal: Thermal) -> float:
    """Slope of the radiator's heat over its thermostat's span, W/K.

    The chord from closed to fully open, UA_rad (T_max - T_amb) / span: within its span the true
    curve, a parabola, lies at most UA_rad span / 4 below.
    """
    full_w = thermal.radiator_w_per_k * (thermal.t_cl_max_degc - thermal.t_amb_degc)
    return full_w / thermal.thermostat_span_k


def thermostat_step(
    thermal: Thermal, duration_s: Floats, start_k: Floats, heat_w: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coolant temperature at the end of stages with constant heat, above the thermostat's opening.

    With u = T - T_open, q the heat and s the radiator's slope,

        C du/dt = q - s max(u, 0),

    whose solution is a straight line below u = 0, an exponential with the time constant C / s
    above, and crosses u = 0 at most once. A long stage would be far too optimistic if its radiator
    were as open all the time as at its end.

    Parameters
    ----------
    thermal : parameters
    duration_s, start_k, heat_w : h, u at the start, q without the radiator; of any one shape

    Returns
    -------
    end_k, per_heat_k_per_w, per_start : u at the end and its derivatives with respect to q and to
        u at the start
    """
    capacity, slope = thermal.heat_capacity_j_per_k, radiator_w_per_k(thermal)
    tau = capacity / slope
    aim = heat_w / slope  # where the exponential leads
    # the line, for as long as the thermostat is closed; then the exponential, from u = 0
    straight = start_k + heat_w * duration_s / capacity
    opens = (start_k < 0.0) & (straight > 0.0)
    closed_s = np.where(opens, -start_k * capacity / np.where(opens, heat_w, 1.0), 0.0)
    decay = np.exp(-(duration_s - closed_s) / tau)
    settled = -np.expm1(-(duration_s - closed_s) / tau)  # 1 - decay, exact for short stages too
    after_line = aim * settled
    # the exponential, for as long as it is open; then the line, from u = 0
    curved = aim + (start_k - aim) * decay
    closes = (start_k >= 0.0) & (curved < 0.0)
    ratio = np.where(closes, (start_k - aim) / np.where(closes, -aim, 1.0), 1.0)
    open_s = tau * np.log(ratio)
    line_s = duration_s - open_s
    shut = np.where(closes, start_k - aim, 1.0)

    cases = [opens, closes, start_k >= 0.0]
    end = np.select(cases, [after_line, heat_w * line_s / capacity, curved], straight)
    per_start = np.select(cases, [decay, -aim / shut, decay], 1.0)
    per_heat = np.select(
        cases,
        [
            settled / slope + decay * closed_s / capacity,
            line_s / capacity + (1.0 + aim / shut) / slope,
            settled / slope,
        ],
        duration_s / capacity,
    )
    return end, per_heat, per_start
