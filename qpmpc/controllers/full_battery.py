"""A second that would leave no room in the battery for the braking to come.

At the plan's prices a second gets the power that its charge is worth. Shortly before the battery
is full the same charge is worth nothing: what goes beyond the room that braking will need is braked
away. The plan has that limit, but 30 iterations keep it roughly, and a price has none.

The same in C: codegen/runtime/mpc_full_battery.c.
"""

import numpy as np

from qpmpc.controllers.last_run import FUEL_LEAST
from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.preview.stages import Stages
from qpmpc.trip import Observation
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.section import STEP_S


def full_battery_w(
    vehicle: Vehicle,
    maps: BatteryMaps,
    fuel_g_per_g: float,
    stages: Stages,
    seconds: int,
    seen: Observation,
) -> float:
    """Return the most power for which the coming second has a use, W; infinite where none is seen.

    With the engine at rest after it, braking puts into the battery at most

        J = max_k (R_k + sum of -h_i l_off,i over 1 <= i <= k),   k = 1 .. N-1

    with R_k = 0 but for the last second of the short horizon, of which it is the room for the
    braking beyond (`qpmpc.preview.swing.rooms`). If J > 0, the second is not to lead beyond
    SOC_max - J / E_bat, with E_bat at the voltage of the limit:

        E <= P0 - P_reach(SOC, max(SOC_max - J / E_bat, SOC_min + `SOC_MARGIN`), 1 s)

    or the least that an engine may give there, if that is more. Nothing is seen where fuel is
    wanted for its heat, w_F < `FUEL_LEAST`, nor by a short horizon of one second. The planner
    holds to it the polished power and that of `empty_battery_w`; where the ramp or a run that
    goes on or begins asks for more, the second gets that.

    Parameters
    ----------
    vehicle, maps : limits and the battery's curves
    fuel_g_per_g : w_F, what a gram of fuel costs in the coming second
    stages : of the plan, from now on
    seconds : N of the short horizon
    seen : the present
    """
    battery, net_w = vehicle.battery, float(stages.net_w[0])
    ahead = slice(1, seconds)
    spent_j = np.cumsum((stages.duration_s * stages.internal_off_w)[ahead])
    gained_j = float((stages.rise_j[ahead] - spent_j).max(initial=0.0))
    if gained_j <= 0.0 or fuel_g_per_g < FUEL_LEAST:
        return np.inf
    full_soc = battery.soc_max - gained_j / maps.energy_j(battery.soc_max)
    full_soc = max(full_soc, battery.soc_min + SOC_MARGIN)
    room_w = net_w - maps.power_to_reach_w(seen.soc, full_soc, STEP_S)
    return max(room_w, vehicle.engine.power_min_w, net_w - vehicle.battery_discharge_max_w)
