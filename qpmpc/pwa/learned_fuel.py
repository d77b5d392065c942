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
PRIOR_IDLE = (NOISE / 0.02) ** 2  # a map is wrong by 2 % of the fuel at full power when idling
PRIOR_SLOPE = (NOISE / 0.1) ** 2  # and by 10 % of it more at full power
PRIOR_LATE = NOISE**2  # all fuel is measured late
IDLE_MOST, SLOPE_MOST = 0.05, 0.3  # greatest distance from the map
RATIO_LEAST, RATIO_MOST = 0.5, 2.0  # of measured fuel and the map's: beyond is no engine's
SUM_MOST = 1e6  # no sum gets there
BEND = 0.1  # tilt at which the breakpoints are chosen

UNKNOWNS = 2 + LATE_S
WEIGHT = np.array([PRIOR_IDLE, PRIOR_SLOPE, *[PRIOR_LATE] * LATE_S])  # of the map


class LearnedFuel:
    """Idle and slope that the fuel map lacks by least squares, forgetful and bounded.

    All fuel is a share of that at full power. With q = P / P_max, f_j the map's fuel j seconds ago,
    of the cold engine, s_j the fuel of a start, u_j = f_j + s_j, and a_j the cold multiplier, 0
    with the engine off, each second with the engine on and the LATE_S after it, in which m is
    measured, is a sample

        m - s_0 - f_0 = idle (a_0 + sum_j late_j (a_j - a_j-1))
                        + slope (a_0 q_0 + sum_j late_j (a_j q_j - a_j-1 q_j-1))
                        + sum_j late_j (u_j - u_j-1),    j = 1 .. LATE_S

    in which late_j is the share of fuel that is measured j seconds late or more: exact for every
    meter whose fuel comes within LATE_S. Without these terms a late meter would make every rise of
    power look as if the map were too high there. With idle and slope, late_j is what was known
    before, between 0 and 1. Left out is what is no engine's at any delay: below RATIO_LEAST times
    the least u_j, or above RATIO_MOST times the greatest. What is known counts KEPT times as much
    from sample to sample; the map, idle and slope 0, counts as PRIOR_IDLE and PRIOR_SLOPE, a meter
    in time as PRIOR_LATE. The curve in use is the greatest convex function below
    f(P) + idle + slope q at the breakpoints,

        slope_k = max over i <= k of min over j > k of (f_j - f_i) / (P_j - P_i).

    The breakpoints are those of a fit of the map tilted by `BEND`: a map that is wrong by as much
    may be concave where the engine is convex, and its own fit has no corner there.

    Parameters
    ----------
    engine, cold, line : of the model
    tolerance_g_per_s : largest error of that fit, at each of the line's powers

    Attributes
    ----------
    power_w, map_g_per_s : breakpoints and the map there
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
        self._fuel = np.zeros(1 + LATE_S)  # u_j
        self._lines = np.zeros((1 + LATE_S, 2))  # a_j, a_j q_j
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
        alpha = share = q = start = 0.0
        if engine_on:
            alpha = alpha_at(self._cold, t_cl_degc)
            share = alpha * self._line.fuel.at(p_eng_w) / self._rated_g
            q = p_eng_w / self._engine.power_max_w
            start = self._engine.start_fuel_g / self._rated_g if started else 0.0
        self._void_s = 1 + LATE_S if q >= 1.0 else max(self._void_s - 1, 0)
        self._fuel = np.append(share + start, self._fuel[:-1])
        self._lines = np.vstack([(alpha, alpha * q), self._lines[:-1]])
        measured = fuel_g / self._rated_g
        least, most = RATIO_LEAST * self._fuel.min(), RATIO_MOST * self._fuel.max()
        if self._void_s == 0 and least <= measured <= most:
            late = np.clip(self._found[2:], 0.0, 1.0)
            line = self._lines[0] + late @ np.diff(self._lines, axis=0)
            x = np.append(line, np.diff(self._fuel))
            self._square = KEPT * self._square + np.outer(x, x)
            self._product = KEPT * self._product + (measured - start - share) * x
        if self._left_s == 0:
            self._fuel, self._lines = np.zeros_like(self._fuel), np.zeros_like(self._lines)

    @property
    def _found(self) -> Floats:
        """Idle, slope and what is late, as they are now."""
        found = np.linalg.solve(self._square + np.diag(WEIGHT), self._product)
        return np.asarray(found, dtype=float)

    @property
    def idle_and_slope(self) -> tuple[float, float]:
        """As they are now; no less fuel than none when idling."""
        idle, slope = (float(value) for value in self._found[:2])
        idle_least = max(-IDLE_MOST, -float(self.map_g_per_s[0]) / self._rated_g)
        return (
            min(max(idle, idle_least), IDLE_MOST),
            min(max(slope, -SLOPE_MOST), SLOPE_MOST),
        )

    @property
    def curve(self) -> PwaFit:
        """The curve as it is now, g/s over W; the bounds of its error are not known."""
        power, (idle, steeper) = self.power_w, self.idle_and_slope
        more = idle + steeper * power / self._engine.power_max_w
        fuel = self.map_g_per_s + self._rated_g * more
        with np.errstate(divide="ignore", invalid="ignore"):
            chord = (fuel[None, :] - fuel[:, None]) / (power[None, :] - power[:, None])
        pieces = range(len(power) - 1)
        slope = np.array([chord[: k + 1, k + 1 :].min(axis=1).max() for k in pieces])
        value = fuel[0] + np.concatenate([[0.0], np.cumsum(slope * np.diff(power))])
        return PwaFit(slope, value[:-1] - slope * power[:-1], power, np.inf, np.inf)
