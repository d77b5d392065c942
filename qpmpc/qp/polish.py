"""The first second minimised at the plan's prices, on the engine's and the battery's own curves.

The plan couples the seconds by SOC and coolant temperature alone. At the prices of the two that the
QP's duals give, each second can be minimised by itself; that of the coming one is, because its
power is what the engine gets. The QP knows fuel and the battery's losses by a few straight pieces
and stops after K iterations; its prices are better than its power.

The same in C: codegen/runtime/mpc_polish.c.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.pwa.curves import Curves
from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel
from qpmpc.pwa.priced import Going, Least, StagePrices, going, least
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

# Of the chords of the engine's line, and the power beyond which it seldom runs, see `Curves.of`.
LINE_TOLERANCE_G_PER_S, LINE_KNEE_W = 2e-4, 20e3


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

    def of_each(self, count: int) -> StagePrices:
        """Return them as those of so many seconds."""
        return StagePrices(*(np.full(count, each) for each in self))


class Polish:
    """Least-cost engine power of a second, engine on.

        min_E  w_F f(E) + w_E E + w_G l(P0 - E)

    with f the fuel of the engine's line, not its fit, which misses where its slope jumps, and
    l(P) = U (U - sqrt(U^2 - 4 R P)) / (2 R) the battery's internal power. On piece i of f, of
    slope a_i, the slope of l has to be r_i = (w_F a_i + w_E) / w_G, at

        P_i = U^2 (1 - 1 / r_i^2) / (4 R),  with R of discharge for r_i > 1, else of charge

    and E is P0 - P_i, within the piece and the limits of the engine and of the battery. f need not
    be convex: E is that of the piece of least cost. Where the curve is learned, f is that.

    Parameters
    ----------
    vehicle, model : of the QP
    learning : whether the fuel curve is learned

    Attributes
    ----------
    curves : f and l
    pieces : the same with the plan's own fuel curve, convex, as it is known now
    maps : of the battery
    """

    def __init__(self, vehicle: Vehicle, model: PwaModel, learning: bool = False) -> None:
        self._vehicle, self.maps = vehicle, BatteryMaps(vehicle.battery)
        self.curves = Curves.of(vehicle, model.line, LINE_TOLERANCE_G_PER_S, LINE_KNEE_W)
        self.pieces = self._with(model.fuel)
        if learning:
            self.curves = self.pieces

    def learn(self, fuel: PwaFit) -> None:
        """Use another fuel curve from now on."""
        self.curves = self.pieces = self._with(fuel)

    def _with(self, fuel: PwaFit) -> Curves:
        curves, power_w = self.curves, fuel.breakpoints
        ohms = curves.discharge_ohm, curves.charge_ohm
        return Curves.through(power_w, fuel(power_w), curves.square_v2, *ohms)

    def internal_w(self, power_w: float) -> float:
        """Return the battery's internal power l(P)."""
        return float(self.curves.internal_w(np.array(power_w)))

    def power_w(self, prices: Prices, net_w: float, planned_w: float) -> float:
        """Return that power, or `planned_w` where a charge in the battery has no price."""
        return float(self._least(prices, np.array([net_w]), planned_w).power_w[0])

    def going(self, prices: Prices, net_w: Floats, off_w: Floats) -> Going:
        """Return seconds of net power P0 and internal power with the engine off l(P0)."""
        on = self._least(prices, net_w, 0.0)
        return going(on, off_w, prices.of_each(len(net_w)))

    def _least(self, prices: Prices, net_w: Floats, planned_w: float) -> Least:
        vehicle, engine = self._vehicle, self._vehicle.engine
        low_w = np.maximum(engine.power_min_w, net_w - vehicle.battery_discharge_max_w)
        high_w = np.minimum(engine.power_max_w, net_w + vehicle.battery_charge_max_w)
        high_w = np.maximum(high_w, low_w)
        if not prices.internal > 0.0:
            low_w = high_w = np.full(len(net_w), planned_w)
            prices = prices._replace(internal=1.0)
        return least(self.curves, net_w, low_w, high_w, prices.of_each(len(net_w)))
