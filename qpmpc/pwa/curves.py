"""The true curves of a stage: fuel of the engine on its line, power out of the battery's store."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

FUEL_TOLERANCE_G_PER_S = 1e-3  # of the chords of the line


@dataclass(frozen=True)
class Curves:
    """Fuel f(E) of the hot engine by chords of its line, in any shape, and l(P) of the battery.

        f(E) = slope_i E + intercept_i  between begin_i and end_i
        l(P) = U (U - sqrt(U^2 - 4 R P)) / (2 R),  R of discharge for P > 0, else of charge

    Attributes
    ----------
    begin_w, end_w, slope, intercept : pieces of the fuel curve, W, W, g/(W s), g/s, shape (m,)
    square_v2 : U^2 at the trip's mean SOC
    discharge_ohm, charge_ohm : R there
    """

    begin_w: Floats
    end_w: Floats
    slope: Floats
    intercept: Floats
    square_v2: float
    discharge_ohm: float
    charge_ohm: float

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        line: OptimalLine,
        tolerance_g_per_s: float = FUEL_TOLERANCE_G_PER_S,
        knee_w: float = np.inf,
    ) -> "Curves":
        """Make the curves of a vehicle with this optimal line.

        Parameters
        ----------
        vehicle, line : car, and line of its engine
        tolerance_g_per_s, knee_w : of the chords; beyond this power times (P / knee)^2
        """
        allowed = tolerance_g_per_s * np.maximum(line.power_w / knee_w, 1.0) ** 2
        kept = chords(line.power_w, line.fuel_g_per_s, allowed)
        maps, soc = BatteryMaps(vehicle.battery), vehicle.trip.soc_mean
        square_v2 = maps.open_circuit.at(soc) ** 2
        ohms = maps.discharge.at(soc), maps.charge.at(soc)
        return cls.through(line.power_w[kept], line.fuel_g_per_s[kept], square_v2, *ohms)

    @classmethod
    def through(
        cls,
        power_w: Floats,
        fuel_g_per_s: Floats,
        square_v2: float,
        discharge_ohm: float,
        charge_ohm: float,
    ) -> "Curves":
        """Make the curves with f straight between these points, shape (m + 1,) each."""
        begin, end = power_w[:-1], power_w[1:]
        slope = np.diff(fuel_g_per_s) / (end - begin)
        intercept = fuel_g_per_s[:-1] - slope * begin
        return cls(begin, end, slope, intercept, square_v2, discharge_ohm, charge_ohm)

    def envelope(self) -> "Curves":
        """Return the same with the convex envelope of f.

        It is what a stage of many seconds can do by sharing its time between two powers.
        """
        power = np.append(self.begin_w, self.end_w[-1])
        fuel = self.fuel_g_per_s(power)
        kept: list[int] = []
        for k in range(len(power)):
            while len(kept) > 1 and _lies_above(power, fuel, kept[-2], kept[-1], k):
                kept.pop()
            kept.append(k)
        ohms = self.discharge_ohm, self.charge_ohm
        return self.through(power[kept], fuel[kept], self.square_v2, *ohms)

    def fuel_g_per_s(self, power_w: Floats) -> Floats:
        """Return f(E), any shape."""
        piece = np.clip(np.searchsorted(self.end_w, power_w), 0, len(self.slope) - 1)
        found: Floats = self.slope[piece] * power_w + self.intercept[piece]
        return found

    def internal_w(self, power_w: Floats) -> Floats:
        """Return l(P), any shape."""
        ohm = np.where(power_w > 0.0, self.discharge_ohm, self.charge_ohm)
        root = np.sqrt(np.maximum(1.0 - 4.0 * ohm * power_w / self.square_v2, 0.0))
        found: Floats = 2.0 * power_w / (1.0 + root)
        # beyond the most that the battery can give the current stays
        return np.where(root > 0.0, found, 0.5 * self.square_v2 / ohm)


def _lies_above(x: Floats, y: Floats, one: int, between: int, other: int) -> bool:
    slope = (y[other] - y[one]) / (x[other] - x[one])
    return bool(y[between] >= y[one] + slope * (x[between] - x[one]))


def chords(x: Floats, y: Floats, tolerance: Floats) -> NDArray[np.intp]:
    """Return points of a sampled curve whose chords stay within `tolerance` of all samples.

    From each point to the furthest one that the samples between allow; shape (pieces + 1,).

    Parameters
    ----------
    x, y, tolerance : at each sample, shape (m,)
    """
    kept, here = [0], 0
    while here < len(x) - 1:
        low, high, furthest = -np.inf, np.inf, here + 1
        for there in range(here + 1, len(x)):
            run = x[there] - x[here]
            slope, room = (y[there] - y[here]) / run, tolerance[there] / run
            if low <= slope <= high:
                furthest = there
            low, high = max(low, slope - room), min(high, slope + room)
            if low > high:
                break
        kept.append(furthest)
        here = furthest
    return np.array(kept)
