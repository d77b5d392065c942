"""The fuel curve as it is learned on the road, from the fuel injected.

The same in C: codegen/runtime/mpc_learned.c. Derivation and choice of the constants: docs/qp.md.
"""

from math import exp

import numpy as np
from numpy.typing import NDArray

from qpmpc.pwa.fit import PwaFit, fit_convex
from qpmpc.vehicle.engine import OptimalLine, alpha_at
from qpmpc.vehicle.engine_parameters import ColdEngine, Engine

Floats = NDArray[np.float64]

KEPT = exp(-1.0 / 900.0)  # of what is known, from one second of the running engine to the next
PRIOR_S = 0.04  # (2 % noise of a measurement / 10 % that a map is wrong by)^2
LEVEL_MOST, TILT_MOST = 0.3, 0.25  # greatest distance from the map
RATIO_LEAST, RATIO_MOST = 0.5, 2.0  # of measured fuel and the map: beyond is no engine's
SUM_MOST = 2.0 / (1.0 - KEPT)  # no sum gets there
BEND = 0.1  # tilt at which the breakpoints are chosen


class LearnedFuel:
    """Level and tilt of the fuel map by least squares, forgetful and bounded.

    With p = 2 P / P_max - 1 and r the hot engine's measured fuel rate over that of the map,

        r = c(p) = level + tilt p,

    of which each second with the engine on is a sample. Samples of the past count KEPT times as
    much every such second; the map, level 1 and tilt 0, counts as PRIOR_S seconds. The curve in use
    is the greatest convex function below c(p) f(P) at the breakpoints,

        slope_k = max over i <= k of min over j > k of (f_j - f_i) / (P_j - P_i).

    The breakpoints are those of a fit of the map tilted by `BEND`: a map that is wrong by as much
    may be concave where the engine is convex, and its own fit has no corner there.

    Parameters
    ----------
    engine, cold, line : of the model
    tolerance_g_per_s : largest error of that fit, at each of the line's powers

    Attributes
    ----------
    level, tilt : as they are now
    most_g : more fuel than any second can take
    """

    def __init__(
        self, engine: Engine, cold: ColdEngine, line: OptimalLine, tolerance_g_per_s: Floats
    ) -> None:
        self._engine, self._cold, self._line = engine, cold, line
        share = 2.0 * line.power_w / line.power_max_w - 1.0
        bent = fit_convex(line.power_w, line.fuel_g_per_s * (1.0 + BEND * share), tolerance_g_per_s)
        self.power_w = bent.breakpoints
        self.map_g_per_s = line.fuel(self.power_w)
        coldest = alpha_at(cold, -50.0)
        self.most_g = RATIO_MOST * coldest * float(self.map_g_per_s[-1]) + engine.start_fuel_g
        self.forget()

    def forget(self) -> None:
        """Go back to the map."""
        self._sums = [0.0] * 5

    def take(self, fuel_g: float, p_eng_w: float, t_cl_degc: float, started: bool) -> None:
        """Learn from a second with the engine on.

        Parameters
        ----------
        fuel_g : injected in it; not a number where it is not known
        p_eng_w : power commanded for it; that of an engine at its limit teaches nothing, since it
            also stands for one that is not known
        t_cl_degc : coolant temperature
        started : whether the engine was started in it
        """
        most_w = self._engine.power_max_w
        if not p_eng_w < most_w:
            return
        fuel_g -= self._engine.start_fuel_g if started else 0.0
        ratio = fuel_g / (alpha_at(self._cold, t_cl_degc) * self._line.fuel.at(p_eng_w))
        if RATIO_LEAST <= ratio <= RATIO_MOST:
            p = 2.0 * p_eng_w / most_w - 1.0
            sample = (1.0, p, p * p, ratio, ratio * p)
            self._sums = [KEPT * old + new for old, new in zip(self._sums, sample, strict=True)]

    @property
    def level_and_tilt(self) -> tuple[float, float]:
        """As they are now."""
        one, p, pp, r, rp = self._sums
        a, c, r = one + PRIOR_S, pp + PRIOR_S, r + PRIOR_S
        divisor = max(a * c - p * p, PRIOR_S * PRIOR_S)
        level, tilt = (c * r - p * rp) / divisor, (a * rp - p * r) / divisor
        return (
            min(max(level, 1.0 - LEVEL_MOST), 1.0 + LEVEL_MOST),
            min(max(tilt, -TILT_MOST), TILT_MOST),
        )

    @property
    def curve(self) -> PwaFit:
        """The curve as it is now, g/s over W; the bounds of its error are not known."""
        power, (level, tilt) = self.power_w, self.level_and_tilt
        fuel = self.map_g_per_s * (level + tilt * (2.0 * power / self._engine.power_max_w - 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            chord = (fuel[None, :] - fuel[:, None]) / (power[None, :] - power[:, None])
        pieces = range(len(power) - 1)
        slope = np.array([chord[: k + 1, k + 1 :].min(axis=1).max() for k in pieces])
        value = fuel[0] + np.concatenate([[0.0], np.cumsum(slope * np.diff(power))])
        return PwaFit(slope, value[:-1] - slope * power[:-1], power, np.inf, np.inf)
