"""The coolant at its lower limit: a run that goes on for heat, and the second that ends it.

A plan of shares rounds away a tenth of a kelvin that the coolant lacks at arrival; a minute later
the safety layer starts the engine for it, for a shortest run. Nor does it see that heat comes in
whole seconds, of which the last gives more than is missing.

The same in C: codegen/runtime/mpc_heating_run.c.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.last_run import MUST_LEAST_S
from qpmpc.controllers.safety import T_CL_MARGIN_K, greatest_w
from qpmpc.preview.stages import Stages
from qpmpc.pwa.curves import Curves
from qpmpc.qp.rows import table_of
from qpmpc.trip import Observation
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.must_run import begun_s
from qpmpc.vehicle.parameters import Thermal, Vehicle
from qpmpc.vehicle.section import STEP_S

IDLING_W = 1.0  # power that stands for idling: 0 would be no wish to run
BEYOND_K = 1e-3  # beyond what is missing: rounding and the fitted curve ask for no other second
LEAST_GROWTH = 1e-3  # of a piece's fuel power with shaft power: heat grows with it


class _Second(NamedTuple):
    """A second of the running engine: fuel, what it costs more than a rest, and heat."""

    fuel_g: float
    dearer_g: float
    heat_w: float


def heating_run_w(
    vehicle: Vehicle,
    curves: Curves,
    power_w: float,
    store_g_per_j: float,
    stages: Stages,
    on_share: NDArray[np.float64],
    is_planned: bool,
    seen: Observation,
) -> float:
    """Return the power at which the engine runs for the heat that is missing; 0 if it need not.

    With the engine at rest the coolant lasts to arrival from T_0, backwards from the end

        T_k-1 = T_k + h_k Q_out(T_k + h_k Q_out(T_k, v_k) / 2 C, v_k) / C

    with T_n = T_cl,min + `T_CL_MARGIN_K`, which the safety layer keeps, and lacks J = C (T_0 - T).
    It loses more the warmer it is: by the losses at the limit three minutes from 44 degC would seem
    to end 0.2 K warmer. Nothing is done unless J > 0, the plan wants no whole run,
    sum_k h_k sigma_k <= b, the shortest one or 1 s, and no second ahead has to run anyway, but the
    last of a shortest run that is under way. Where starts cost nothing and the plan runs the engine
    in the coming second, as the first of a run only where b = 1, it may want b + 1: it keeps a
    margin, and so wants more than is missing.

    With m and Q the fuel and the heat of the coming second at its least-cost power E, and c the
    fuel of a start, a run whose start cost something goes on at E if that burns no more than one
    more, J / Q <= b + c / m.

    A second of such a run, one in which the plan runs an engine that starts at no cost, and one in
    which the coolant would leave its limit without it end what is missing, if they can. A start
    gives Q_s by itself and Q in each of the other b - 1 seconds of its run: left are
    J' = J - Q_s - (b - 1) Q + C `BEYOND_K`. Where that is more than Q and less than 2 Q, the power
    is E' = Q^-1(J') instead, if it costs no more than two seconds at E: d(E') <= 2 d(E), with
    d(P) = alpha f(P) - w_G (l(P0) - l(P0 - P)), and engine, ramp and the battery's charging allow
    it.

    Parameters
    ----------
    vehicle : gives b, c, C, Q_out
    curves : f, convex, and l
    power_w : E, least-cost power of the coming second
    store_g_per_j : w_G, what a joule of the battery's store costs in it
    stages : of the plan, from now on
    on_share : sigma of each stage by the plan, shape (n,)
    is_planned : whether the plan runs the engine in the coming second
    seen : the present
    """
    engine, thermal, t_cl_degc = vehicle.engine, vehicle.thermal, seen.t_cl_degc
    run_s, wanted_s = max(engine.min_on_s, 1), (stages.duration_s * np.maximum(on_share, 0.0)).sum()
    limit_degc = thermal.t_cl_min_degc + T_CL_MARGIN_K
    lack_j = thermal.heat_capacity_j_per_k * (_lasts_from_degc(thermal, stages) - t_cl_degc)
    held_s = begun_s(vehicle, seen.engine_on, seen.engine_for_s)
    has_start = table_of(engine).has_start
    may = seen.engine_on or run_s == 1  # else the plan has to keep to a start, which it may not
    runs_anyway = is_planned and may and not has_start
    most_s = run_s + 1 if runs_anyway else run_s
    decides = held_s <= 1 and stages.must_s - held_s <= MUST_LEAST_S and wanted_s <= most_s
    if lack_j <= 0.0 or not decides:
        return 0.0
    hot_w = alpha_at(vehicle.cold_engine, t_cl_degc) * engine.lhv_j_per_g
    net_w, off_w = float(stages.net_w[0]), float(stages.internal_off_w[0])

    def second(power_w: float) -> _Second:
        fuel_w = hot_w * float(curves.fuel_g_per_s(np.array(power_w)))
        fuel_g = fuel_w / engine.lhv_j_per_g
        gain_w = off_w - float(curves.internal_w(np.array(net_w - power_w)))
        dearer_g = fuel_g - store_g_per_j * gain_w
        return _Second(fuel_g, dearer_g, engine_w(thermal, fuel_w, power_w))

    one = second(power_w)
    left_j = lack_j + BEYOND_K * thermal.heat_capacity_j_per_k
    if seen.engine_on and has_start:
        beyond_j = lack_j - run_s * one.heat_w
        if beyond_j * one.fuel_g > engine.start_fuel_g * one.heat_w:
            return 0.0
        least_w = max(power_w, IDLING_W)
    else:
        rested_k = STEP_S * cooling_w(thermal, t_cl_degc, float(stages.speed_mps[0]))
        is_cold = t_cl_degc - rested_k / thermal.heat_capacity_j_per_k < limit_degc
        if not is_cold and not runs_anyway:
            return 0.0
        if not seen.engine_on:
            left_j -= engine_w(thermal, engine.start_fuel_g * engine.lhv_j_per_g, 0.0)
            left_j -= (run_s - 1) * STEP_S * one.heat_w
        least_w = 0.0
    if one.heat_w < left_j / STEP_S < 2.0 * one.heat_w:
        all_w = _power_w(vehicle, curves, hot_w, left_j / STEP_S)
        most_w = min(greatest_w(engine, seen, STEP_S), net_w + vehicle.battery_charge_max_w)
        if all_w <= most_w and second(all_w).dearer_g <= 2.0 * one.dearer_g:
            return all_w
    return least_w


def _power_w(vehicle: Vehicle, curves: Curves, hot_w: float, heat_w: float) -> float:
    """Return the power that gives this heat: the least over the pieces, as fuel is the greatest.

    A piece on which heat does not grow with power bounds nothing; infinite where none does.
    """
    kept = engine_w(vehicle.thermal, 1.0, 0.0)
    grows = hot_w * curves.slope - 1.0
    above_w = heat_w / kept - hot_w * curves.intercept
    of_pieces = np.where(grows > LEAST_GROWTH, above_w / np.maximum(grows, LEAST_GROWTH), np.inf)
    return float(of_pieces.min())


def _lasts_from_degc(thermal: Thermal, stages: Stages) -> float:
    """Return the coolant that with the engine at rest just needs no start before arrival, T_0."""
    t_cl_degc = thermal.t_cl_min_degc + T_CL_MARGIN_K
    for h, speed_mps in zip(
        stages.duration_s[::-1].tolist(), stages.speed_mps[::-1].tolist(), strict=True
    ):
        per_w = h / thermal.heat_capacity_j_per_k
        middle_degc = t_cl_degc + 0.5 * per_w * cooling_w(thermal, t_cl_degc, speed_mps)
        t_cl_degc += per_w * cooling_w(thermal, middle_degc, speed_mps)
    return t_cl_degc
