"""The coolant over a stage in which its thermostat opens or closes: exact, with derivatives.

The functions are in the subset of `qpmpc.qp.expressions`: the generated C is made from them.
"""

import numpy as np
from numpy import exp, expm1, log1p, where
from numpy.typing import NDArray

from qpmpc.vehicle.parameters import Thermal

Floats = NDArray[np.float64]


def radiator_w_per_k(th: Thermal) -> float:
    """Slope of the radiator's heat over its thermostat's span, W/K.

    The chord from closed to fully open, UA_rad (T_max - T_amb) / span: within its span the true
    curve, a parabola, lies at most UA_rad span / 4 below. Without a radiator, or where the limit
    is below the ambient temperature, it is not 0 but so small that it takes no heat: what follows
    divides by it.
    """
    full_w = th.radiator_w_per_k * (th.t_cl_max_degc - th.t_amb_degc)
    return max(full_w / th.thermostat_span_k, 1e-3)


def thermostat_step(
    th: Thermal, duration_s: Floats, start_k: Floats, heat_w: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coolant temperature at the end of stages with constant heat, above the thermostat's opening.

    With u = T - T_open, q the heat and s the radiator's slope,

        C du/dt = q - s max(u, 0),

    whose solution is a straight line below u = 0, an exponential with the time constant C / s
    above, and crosses u = 0 at most once. A long stage would be far too optimistic if its radiator
    were as open all the time as at its end.

    Parameters
    ----------
    th : parameters
    duration_s, start_k, heat_w : h, u at the start, q without the radiator; of any one shape

    Returns
    -------
    over_k, per_heat, per_start : u at the end and its derivatives with respect to q and to
        u at the start
    """
    capacity = th.heat_capacity_j_per_k
    slope = radiator_w_per_k(th)
    tau = capacity / slope
    aim = heat_w / slope  # limit of the exponential
    # the line, for as long as the thermostat is closed; then the exponential, from u = 0
    straight = start_k + heat_w * duration_s / capacity
    opens = where(start_k < 0.0, where(straight > 0.0, 1.0, 0.0), 0.0)
    closed_s = where(opens > 0.0, -start_k * capacity / where(opens > 0.0, heat_w, 1.0), 0.0)
    ever = where(start_k < 0.0, opens, 1.0)  # open
    open_for = where(ever > 0.0, -(duration_s - closed_s) / tau, 0.0)
    decay = exp(open_for)  # also if it never is open, so that C does the same work
    settled = -expm1(open_for)  # 1 - decay, exact for short stages too
    # the exponential, for as long as it is open; then the line, from u = 0
    apart = start_k - aim
    curved = start_k * decay + aim * settled  # no difference of large numbers for a small slope
    closes = where(start_k >= 0.0, where(curved < 0.0, 1.0, 0.0), 0.0)
    shut = where(closes > 0.0, apart, 1.0)
    share = where(closes > 0.0, start_k / where(closes > 0.0, -aim, 1.0), 0.0)
    line_s = duration_s - tau * log1p(share)

    uncrossed = where(start_k >= 0.0, curved, straight)
    crossed = where(closes > 0.0, heat_w * line_s / capacity, uncrossed)
    opened = aim * settled
    over_k = where(opens > 0.0, opened, crossed)
    closing = where(closes > 0.0, -aim / shut, where(start_k >= 0.0, decay, 1.0))
    per_start = where(opens > 0.0, decay, closing)
    by_curve = settled / slope
    by_line = duration_s / capacity
    line = where(start_k >= 0.0, by_curve, by_line)
    bent = where(closes > 0.0, line_s / capacity + start_k / shut / slope, line)
    per_heat = where(opens > 0.0, by_curve + decay * closed_s / capacity, bent)
    return over_k, per_heat, per_start
