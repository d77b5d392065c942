"""Knowledge of the trip ahead: a forecast, separate from the true cycle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.demand import demand_w
from qpmpc.vehicle.parameters import Vehicle


@dataclass(frozen=True)
class Trace:
    """Demand and speed of each 1 s step of a trip, true or forecast.

    Attributes
    ----------
    demand_w : P_d, negative when braking, shape (steps,)
    speed_mps : mean speed of each step, shape (steps,)
    """

    demand_w: NDArray[np.float64]
    speed_mps: NDArray[np.float64]

    @property
    def steps(self) -> int:
        """Number of 1 s steps."""
        return len(self.demand_w)

    @classmethod
    def of(cls, cycle: Cycle, vehicle: Vehicle) -> "Trace":
        """Compute the demand and speed trace of a cycle."""
        return cls(demand_w(cycle, vehicle), cycle.step_speed_mps)

    def battery_side_w(self, vehicle: Vehicle) -> NDArray[np.float64]:
        """Net power asked of engine and battery, P0 = P_d + P_aux, W, shape (steps,).

        Braking beyond the battery's charge limit goes to the friction brakes, and the demand is
        limited to what engine and battery can give together.
        """
        battery = vehicle.battery
        most = vehicle.battery_discharge_max_w + vehicle.engine.power_max_w
        net = self.demand_w + battery.aux_power_w
        return np.clip(net, -vehicle.battery_charge_max_w, most)

    def internal_off_w(self, vehicle: Vehicle) -> NDArray[np.float64]:
        """Internal battery power of each step with the engine off, l(P0), W, shape (steps,)."""
        return internal_off_w(vehicle, self.battery_side_w(vehicle))


def internal_off_w(vehicle: Vehicle, net_w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Internal battery power when it alone meets P0, l(P0), W; same shape.

    At the trip's mean SOC; beyond the discharge limit, at that limit.
    """
    power = np.minimum(net_w, vehicle.battery_discharge_max_w)
    return BatteryMaps(vehicle.battery).internal_power_w(vehicle.trip.soc_mean, power)
