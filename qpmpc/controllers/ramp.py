"""Engine power that a second needs because power rises no faster than the engine's ramp.

The plan knows no ramp. Where the battery is nearly empty, or a demand comes that it cannot meet
alone, the engine has to be on its way up in good time.

The same in C: codegen/runtime/mpc_ramp.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.safety import POWER_MARGIN_W
from qpmpc.qp.rows import SOC_KEPT
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle


class RampFloor:
    """Least engine power of a second, after which the next ones can be driven.

    k seconds after one at power P the engine gives P + r k at most, r k / 2 more than P in the
    mean until then. The battery has to give the rest: in second k no more than its limit, and in
    all seconds up to it no more than empties it. So P is at least

        P0_k - P_discharge - r k
        mean(P0_0, ..., P0_k) - P_reach(soc, soc_min, k + 1) - r k / 2

    for k = 1, 2, ..., with P_reach the battery power that leads to the limit in k + 1 seconds. An
    engine that is off has P = 0. The coming second itself is the safety layer's, and so is each of
    the next: r and P_discharge are smaller by the margin that it keeps from them.

    Parameters
    ----------
    vehicle : gives r = `engine.ramp_w_per_s` and the battery
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._maps = BatteryMaps(vehicle.battery)

    def least_w(self, net_w: NDArray[np.float64], soc: float) -> float:
        """Return that power, W, from 0 to that of the engine.

        Parameters
        ----------
        net_w : P0 of the seconds that come, to the end of the short horizon or to arrival,
            shape (n,)
        soc : state of charge now
        """
        battery, engine = self._vehicle.battery, self._vehicle.engine
        at_most_w = self._vehicle.battery_discharge_max_w - POWER_MARGIN_W
        to_spare = max(soc - (battery.soc_min + SOC_KEPT), 0.0)
        seconds_w = net_w.tolist()
        total_w, least_w = sum(seconds_w[:1]), 0.0
        for k, second_w in enumerate(seconds_w[1:], start=1):
            total_w += second_w
            risen_w = (engine.ramp_w_per_s - POWER_MARGIN_W) * k
            gives_w = self._maps.power_to_reach_w(soc, soc - to_spare, k + 1.0)
            at_once_w = second_w - at_most_w - risen_w
            in_all_w = total_w / (k + 1.0) - gives_w - 0.5 * risen_w
            least_w = max(least_w, at_once_w, in_all_w)
        return min(least_w, engine.power_max_w)
