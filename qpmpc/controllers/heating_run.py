"""A run of the engine that goes on, where the coolant would not last to arrival without one more.

A plan of shares rounds away a tenth of a kelvin that the coolant lacks at arrival; a minute later
the safety layer starts the engine for it, for a shortest run.

The same in C: codegen/runtime/mpc_heating_run.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.safety import T_CL_MARGIN_K
from qpmpc.preview.stages import Stages
from qpmpc.pwa.fit import PwaFit
from qpmpc.qp.last_run import MUST_LEAST_S
from qpmpc.qp.rows import table_of
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.parameters import Thermal, Vehicle

IDLING_W = 1.0  # power that stands for idling: 0 would be no wish to run


def heating_run_w(
    vehicle: Vehicle,
    fuel: PwaFit,
    power_w: float,
    stages: Stages,
    on_share: NDArray[np.float64],
    t_cl_degc: float,
) -> float:
    """Return the power at which a run goes on for the heat that is missing; 0 if it need not.

    With the engine at rest the coolant lasts to arrival from T_0, backwards from the end

        T_k-1 = T_k + h_k Q_out(T_k + h_k Q_out(T_k, v_k) / 2 C, v_k) / C

    with T_n = T_cl,min + `T_CL_MARGIN_K`, which the safety layer keeps, and lacks J = C (T_0 - T).
    It loses more the warmer it is: by the losses at the limit three minutes from 44 degC would seem
    to end 0.2 K warmer.

    With m and Q the fuel and the heat of the engine at the least-cost power of the coming second,
    c those of a start and b the shortest run, the run goes on if that burns no more than one more,
    0 < J / Q <= b + c / m, while the plan wants no whole one, sum_k h_k sigma_k <= b, and no second
    ahead has to run anyway. Only where a start costs something. To be asked while the engine runs.

    Parameters
    ----------
    vehicle : gives b, C, Q_out
    fuel : curve of the plan
    power_w : that power at the plan's prices, see `Polish`
    stages : of the plan, from now on
    on_share : sigma of each stage by the plan, shape (n,)
    t_cl_degc : coolant now
    """
    engine, thermal = vehicle.engine, vehicle.thermal
    wanted_s = float((stages.duration_s * np.maximum(on_share, 0.0)).sum())
    has_to_run = stages.must_s > MUST_LEAST_S
    if not table_of(engine).has_start or has_to_run or wanted_s > engine.min_on_s:
        return 0.0
    lack_j = thermal.heat_capacity_j_per_k * (_lasts_from_degc(thermal, stages) - t_cl_degc)
    fuel_w = alpha_at(vehicle.cold_engine, t_cl_degc) * engine.lhv_j_per_g * float(fuel(power_w))
    heat_w = engine_w(thermal, fuel_w, power_w)
    beyond_j = (lack_j - engine.min_on_s * heat_w) * fuel_w
    is_one_run = lack_j > 0.0 and beyond_j <= engine.start_fuel_g * engine.lhv_j_per_g * heat_w
    return max(power_w, IDLING_W) if is_one_run else 0.0


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
