"""The first second minimised at the plan's prices, on the battery's own curve.

The plan couples the seconds by SOC and coolant temperature alone. At the prices of the two that the
QP's duals give, each second can be minimised by itself; that of the coming one is, because its
power is what the engine gets. The QP knows the battery's losses by a few straight pieces and stops
after K iterations; its prices are better than its power.

The same in C: codegen/runtime/mpc_polish.c.
"""

from typing import NamedTuple

import numpy as np

from qpmpc.preview.stages import Stages
from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle

LEAST_RATIO = 1e-3  # of prices: below it charging is for nothing, and has no least cost


class Prices(NamedTuple):
    """What a second's rates cost, duals of SOC and coolant included, all per second of it.

    Attributes
    ----------
    fuel : g per g of fuel of the hot engine
    p_eng : g per J of engine work
    internal : g per J from the battery's store
    """

    fuel: float
    p_eng: float
    internal: float


class Going(NamedTuple):
    """A second with the engine on, at its least-cost power, against the same with it off.

    Attributes
    ----------
    power_w : E
    gain_w : g = l(P0) - l(P0 - E), what the battery's store gains by it
    dearer_g_per_s : d = w_F f(E) + w_E E - w_G g, what it costs more at the plan's prices
    """

    power_w: float
    gain_w: float
    dearer_g_per_s: float


class Polish:
    """Least-cost engine power of a second, engine on.

        min_E  w_F f(E) + w_E E + w_G l(P0 - E)

    with f the fitted fuel curve of slopes a_i and l(P) = U (U - sqrt(U^2 - 4 R P)) / (2 R) the
    battery's internal power. On piece i the slope of l has to be r_i = (w_F a_i + w_E) / w_G, at

        P_i = U^2 (1 - 1 / r_i^2) / (4 R),  with R of discharge for r_i > 1, else of charge

    and E is the least of max(P0 - P_i, begin of piece i), within the limits of the engine and of
    the battery.

    Parameters
    ----------
    vehicle, model : of the QP

    Attributes
    ----------
    fuel : f, as it is known now
    maps : of the battery
    """

    def __init__(self, vehicle: Vehicle, model: PwaModel) -> None:
        maps, soc = BatteryMaps(vehicle.battery), vehicle.trip.soc_mean
        self._vehicle, self.maps = vehicle, maps
        self.learn(model.fuel)
        square = maps.open_circuit.at(soc) ** 2
        self._discharge_w = square / (4.0 * maps.discharge.at(soc))
        self._charge_w = square / (4.0 * maps.charge.at(soc))

    def learn(self, fuel: PwaFit) -> None:
        """Use another fuel curve from now on."""
        self.fuel = fuel

    def internal_w(self, power_w: float) -> float:
        """Return the battery's internal power l(P)."""
        soc = self._vehicle.trip.soc_mean
        return float(self.maps.internal_power_w(soc, np.array([power_w]))[0])

    def power_w(self, prices: Prices, net_w: float, planned_w: float) -> float:
        """Return that power, or `planned_w` where a charge in the battery has no price."""
        if not prices.internal > 0.0:
            return planned_w
        vehicle, engine = self._vehicle, self._vehicle.engine
        ratio = (prices.fuel * self.fuel.slope + prices.p_eng) / prices.internal
        ratio = np.maximum(ratio, LEAST_RATIO)
        most_w = np.where(ratio > 1.0, self._discharge_w, self._charge_w)
        best_w = net_w - most_w * (1.0 - 1.0 / ratio**2)
        low_w = max(engine.power_min_w, net_w - vehicle.battery_discharge_max_w)
        high_w = max(min(engine.power_max_w, net_w + vehicle.battery_charge_max_w), low_w)
        return min(max(float(np.maximum(best_w, self.fuel.breakpoints[:-1]).min()), low_w), high_w)

    def going(self, prices: Prices, net_w: float, off_w: float) -> Going:
        """Return the second of net power P0 and internal power with the engine off l(P0)."""
        power_w = self.power_w(prices, net_w, 0.0)
        gain_w = off_w - self.internal_w(net_w - power_w)
        spent = prices.fuel * float(self.fuel(power_w)) + prices.p_eng * power_w
        return Going(power_w, gain_w, spent - prices.internal * gain_w)

    def going_in(self, prices: Prices, stages: Stages, k: int) -> Going:
        """Return the k-th of the coming seconds."""
        return self.going(prices, float(stages.net_w[k]), float(stages.internal_off_w[k]))
