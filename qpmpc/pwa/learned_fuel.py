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

LATE_S = 3  # that fuel may be measured late, at most
KEPT = exp(-1.0 / 900.0)  # of what is known, from one sample to the next
NOISE = 0.002  # of a sample's fuel, of that at full power
PRIOR = (NOISE / 0.1) ** 2  # a map is wrong by 10 %
PRIOR_LATE = NOISE**2  # all fuel is measured late
LEVEL_MOST, TILT_MOST = 0.3, 0.25  # greatest distance from the map
RATIO_LEAST, RATIO_MOST = 0.5, 2.0  # of measured fuel and the map's: beyond is no engine's
SUM_MOST = 1e6  # no sum gets there
BEND = 0.1  # tilt at which the breakpoints are chosen

UNKNOWNS = 2 + LATE_S
WEIGHT = np.array([PRIOR, PRIOR, *[PRIOR_LATE] * LATE_S])  # of the map
MAP = WEIGHT * np.eye(UNKNOWNS)[0]  # level 1


class LearnedFuel:
    """Level and tilt of the fuel map by least squares, forgetful and bounded.

    With p = 2 P / P_max - 1, f_j the map's fuel j seconds ago, of the cold engine, as a share of
    that at full power, s_j the fuel of a start, and u_j = f_j + s_j, each second with the engine on
    and the LATE_S after it, in which m is measured, is a sample

        m - s_0 = level f_0 + tilt (f_0 p_0 + sum_j late_j (f_j p_j - f_j-1 p_j-1))
                  + sum_j late_j (u_j - u_j-1),    j = 1 .. LATE_S

    in which late_j is the share of fuel that is measured j seconds late or more: exact for every
    meter whose fuel comes within LATE_S, if level is 1. Without these terms a late meter would make
    every rise of power look as if the map were too high there. With tilt, late_j is what was known
    before, between 0 and 1. Left out is what is no engine's at any delay: below RATIO_LEAST times
    the least u_j, or above RATIO_MOST times the greatest. What is known counts KEPT times as much
    from sample to sample; the map, level 1 and tilt 0, counts as PRIOR, a meter in time as
    PRIOR_LATE. The curve in use is the greatest convex function below c(p) f(P), where
    c = level + tilt p, at the breakpoints,

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
        self._rated_g = float(self.map_g_per_s[-1])
        self.most_g = RATIO_MOST * alpha_at(cold, -50.0) * self._rated_g + engine.start_fuel_g
        self.forget()

    def forget(self) -> None:
        """Go back to the map."""
        self._square = np.zeros((UNKNOWNS, UNKNOWNS))
        self._product = np.zeros(UNKNOWNS)
        self._fuel, self._tilted = np.zeros(1 + LATE_S), np.zeros(1 + LATE_S)  # u_j, f_j p_j
        self._left_s = self._void_s = 0

    def take(
        self, fuel_g: float, p_eng_w: float, t_cl_degc: float, engine_on: bool, started: bool
    ) -> None:
        """Learn from a second.

        Parameters
        ----------
        fuel_g : measured in it; not a number where it is not known
        p_eng_w : power commanded for it; that of an engine at its limit also stands for one that is
            not known: nothing is learned while its fuel may come
        t_cl_degc : coolant temperature
        engine_on, started : whether the engine was on in it, and was started in it
        """
        if not engine_on and self._left_s == 0:
            return
        self._left_s = LATE_S if engine_on else self._left_s - 1
        share = p = start = 0.0
        if engine_on:
            share = alpha_at(self._cold, t_cl_degc) * self._line.fuel.at(p_eng_w) / self._rated_g
            p = 2.0 * p_eng_w / self._engine.power_max_w - 1.0
            start = self._engine.start_fuel_g / self._rated_g if started else 0.0
        self._void_s = 1 + LATE_S if p >= 1.0 else max(self._void_s - 1, 0)
        self._fuel = np.append(share + start, self._fuel[:-1])
        self._tilted = np.append(share * p, self._tilted[:-1])
        measured = fuel_g / self._rated_g
        least, most = RATIO_LEAST * self._fuel.min(), RATIO_MOST * self._fuel.max()
        if self._void_s == 0 and least <= measured <= most:
            late = np.clip(self._found[2:], 0.0, 1.0)
            tilted = self._tilted[0] + late @ np.diff(self._tilted)
            x = np.array([share, tilted, *np.diff(self._fuel)])
            self._square = KEPT * self._square + np.outer(x, x)
            self._product = KEPT * self._product + (measured - start) * x
        if self._left_s == 0:
            self._fuel, self._tilted = np.zeros(1 + LATE_S), np.zeros(1 + LATE_S)

    @property
    def _found(self) -> Floats:
        """Level, tilt and what is late, as they are now."""
        return np.linalg.solve(self._square + np.diag(WEIGHT), self._product + MAP)

    @property
    def level_and_tilt(self) -> tuple[float, float]:
        """As they are now."""
        level, tilt = (float(value) for value in self._found[:2])
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
