"""The coolant's row: heat balance and thermostat of each stage, expanded about a plan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.vehicle.parameters import Thermal, Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CoolantRow:
    """Coolant balance of each stage, expanded; shape (n,) each.

    With the heat

        q = (1 - x) [LHV (alpha F + growth (T_mean - T^)) - E] - UA (T_mean - T_amb) - Q_cabin,

    alpha and growth = alpha' F^ taken at T^, and T_mean the mean of the stage's ends, the row is

        T = T_end(q^, T^_start) + per_heat (q - q^) + per_start (T_before - T^_start),

    or, everything that does not depend on the variables put into `constant_degc`,

        T = per_start T_before + per_heat [(1 - x)(LHV alpha F - E) - w_per_k T_mean] + constant.

    Attributes
    ----------
    alpha, growth_g_per_s_per_k : alpha(T^) and alpha'(T^) F^
    w_per_k : UA - (1 - x) LHV growth, heat lost for each kelvin of T_mean
    per_heat_k_per_w, per_start : derivatives of T at the end of the stage
    constant_degc : what remains
    """

    alpha: Floats
    growth_g_per_s_per_k: Floats
    w_per_k: Floats
    per_heat_k_per_w: Floats
    per_start: Floats
    constant_degc: Floats


def coolant_row(
    vehicle: Vehicle, model: PwaModel, stages: Stages, about: Linearisation
) -> CoolantRow:
    """Expand the coolant balance of all stages about a plan, paper eqs. (3) to (5)."""
    th, lhv_j_per_g = vehicle.thermal, vehicle.engine.lhv_j_per_g
    share = 1.0 - th.exhaust_share
    alpha = model.alpha(about.t_cl_degc)
    growth = model.alpha.active_slope(about.t_cl_degc) * about.fuel_g_per_s
    ua = th.ua0_w_per_k + th.ua1_w_per_k_per_mps * stages.speed_mps
    w_per_k = ua - share * lhv_j_per_g * growth
    heat_at_zero = ua * th.t_amb_degc - share * lhv_j_per_g * growth * about.t_cl_degc
    heat_at_zero -= _cabin_w(th, about.t_cl_degc)
    start = about.t_cl_start_degc
    heat = share * (lhv_j_per_g * alpha * about.fuel_g_per_s - about.p_eng_w)
    heat += heat_at_zero - w_per_k * 0.5 * (start + about.t_cl_end_degc)
    end, per_heat, per_start = coolant_step(th, stages.duration_s, start, heat)
    constant = end + per_heat * (heat_at_zero - heat) - per_start * start
    return CoolantRow(alpha, growth, w_per_k, per_heat, per_start, constant)


def _cabin_w(th: Thermal, t_cl_degc: Floats) -> Floats:
    span = th.cabin_heat_full_degc - th.cabin_heat_from_degc
    return th.cabin_heat_w * np.clip((t_cl_degc - th.cabin_heat_from_degc) / span, 0.0, 1.0)


def radiator_w_per_k(thermal: Thermal) -> float:
    """Slope of the radiator's heat over its thermostat's span, W/K.

    The chord from closed to fully open, UA_rad (T_max - T_amb) / span: within its span the true
    curve, a parabola, lies at most UA_rad span / 4 below.
    """
    full_w = thermal.radiator_w_per_k * (thermal.t_cl_max_degc - thermal.t_amb_degc)
    return full_w / thermal.thermostat_span_k


def coolant_step(
    thermal: Thermal, duration_s: Floats, start_degc: Floats, heat_w: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coolant temperature at the end of stages with constant heat.

    With u = T - T_open, q the heat and s the radiator's slope,

        C du/dt = q - s max(u, 0),

    whose solution is a straight line below u = 0, an exponential with the time constant C / s
    above, and crosses u = 0 at most once. A long stage would be far too optimistic if its radiator
    were as open all the time as at its end.

    Parameters
    ----------
    thermal : parameters
    duration_s, start_degc, heat_w : h, T at the start, q without the radiator; shape (n,) each

    Returns
    -------
    end_degc, per_heat_k_per_w, per_start : T at the end and its derivatives with respect to q and
        to T at the start
    """
    capacity, slope = thermal.heat_capacity_j_per_k, radiator_w_per_k(thermal)
    tau = capacity / slope
    start = start_degc - thermal.thermostat_open_degc
    aim = heat_w / slope  # where the exponential leads
    # the line, for as long as the thermostat is closed; then the exponential, from u = 0
    straight = start + heat_w * duration_s / capacity
    opens = (start < 0.0) & (straight > 0.0)
    closed_s = np.where(opens, -start * capacity / np.where(opens, heat_w, 1.0), 0.0)
    decay = np.exp(-(duration_s - closed_s) / tau)
    settled = -np.expm1(-(duration_s - closed_s) / tau)  # 1 - decay, exact for short stages too
    after_line = aim * settled
    # the exponential, for as long as it is open; then the line, from u = 0
    curved = aim + (start - aim) * decay
    closes = (start >= 0.0) & (curved < 0.0)
    ratio = np.where(closes, (start - aim) / np.where(closes, -aim, 1.0), 1.0)
    open_s = tau * np.log(ratio)
    line_s = duration_s - open_s
    shut = np.where(closes, start - aim, 1.0)

    cases = [opens, closes, start >= 0.0]
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
    return end + thermal.thermostat_open_degc, per_heat, per_start
