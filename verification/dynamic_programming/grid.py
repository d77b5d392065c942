"""Grids of the state: the whole admissible box, or a tube around a path."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from qpmpc.verification.dynamic_programming.engine_states import EngineStates
from qpmpc.verification.dynamic_programming.kernels import Floats, Lattice, LatticeAxis
from qpmpc.verification.dynamic_programming.power_limits import PowerLimits
from qpmpc.verification.dynamic_programming.problem import Problem
from qpmpc.verification.dynamic_programming.trajectory import Trajectory

LEAST_CELL = 0.02
"""Of the two cells at the limits, which a drifting lattice cuts, in whole ones."""


@dataclass(frozen=True)
class Axis:
    """Nodes of a lattice that drifts between two fixed limits, at the times k = 0..n.

    The nodes at time k are the lower limit, low + spacing (phase_k + 0 .. cells-1), and the upper
    limit; the phase is the drift in cells without its whole part. A grid holds `points` of them
    from number offset_k on.

    Attributes
    ----------
    low, spacing, cells : lower limit, width of a whole cell, whole cells from limit to limit
    points : nodes at one time
    phase, offset : shape (n+1,)
    """

    low: float
    spacing: float
    cells: int
    points: int
    phase: Floats
    offset: NDArray[np.int64]

    @classmethod
    def full(cls, low: float, high: float, spacing: float, drift: Floats) -> Self:
        """Cover low..high at all times with cells of at most `spacing`.

        Parameters
        ----------
        drift : distance that the lattice has gone at each time, shape (n+1,)
        """
        cells = max(2, int(np.ceil((high - low) / spacing - 1e-9)))
        spacing = (high - low) / cells
        phase = np.clip(drift / spacing % 1.0, LEAST_CELL, 1.0 - LEAST_CELL)
        return cls(low, spacing, cells, cells + 2, phase, np.zeros(len(drift), dtype=np.int64))

    @classmethod
    def around(
        cls,
        path: Floats,
        half_width: float,
        low: float,
        high: float,
        spacing: float,
        drift: Floats,
    ) -> Self:
        """Cover the path by at least +-half_width at all times, cut at low and high."""
        whole = cls.full(low, high, spacing, drift)
        points = min(2 * int(np.ceil(half_width / whole.spacing)) + 1, whole.points)
        centre = np.rint((path - low) / whole.spacing - whole.phase).astype(np.int64) + 1
        offset = np.clip(centre - points // 2, 0, whole.points - points)
        return cls(low, whole.spacing, whole.cells, points, whole.phase, offset)

    def at(self, k: int) -> LatticeAxis:
        """What compiled code needs of time k."""
        return LatticeAxis(
            self.low, self.spacing, self.cells, float(self.phase[k]), int(self.offset[k])
        )

    def nodes(self, k: int) -> Floats:
        """All nodes at time k, shape (points,)."""
        first = int(self.offset[k])
        nodes: Floats = self.low + self.spacing * (first - 1 + self.phase[k] + self._numbers)
        if first == 0:
            nodes[0] = self.low
        if first + self.points == self.cells + 2:
            nodes[-1] = self.low + self.spacing * self.cells
        return nodes

    @cached_property
    def _numbers(self) -> Floats:
        return np.arange(float(self.points))

    def clearance(self, path: Floats) -> float:
        """Least distance of a path from those edges that are not limits, in half widths."""
        position = (path - self.low) / self.spacing - self.phase + 1.0 - self.offset
        half = 0.5 * (self.points - 1)
        lower = np.where(self.offset > 0, position, half)
        top = self.cells + 2 - self.points
        upper = np.where(self.offset < top, self.points - 1 - position, half)
        return float(min(lower.min(), upper.min()) / half)


@dataclass(frozen=True)
class Grid:
    """SOC and coolant axes, and the spacing of the engine power.

    Both lattices drift as the state does while the engine is off. Its second then leads from
    node to node, nearly, and interpolation does not spread the value function over the cells: over
    minutes with the engine off, each of a small part of a cell, that is what spreads it most.
    """

    soc: Axis
    t_cl: Axis
    power_step_w: float

    @classmethod
    def full(
        cls, problem: Problem, soc_step: float, t_cl_step_k: float, power_step_w: float
    ) -> Self:
        """Cover everything within the limits."""
        constants, n = problem.constants, problem.steps
        soc = np.full(n, problem.soc_init)
        t_cl = np.full(n, constants.t_cl_min_degc)
        drift = problem.drift(soc, t_cl)
        return cls(
            Axis.full(constants.soc_min, constants.soc_max, soc_step, drift[0]),
            Axis.full(constants.t_cl_min_degc, constants.t_cl_max_degc, t_cl_step_k, drift[1]),
            power_step_w,
        )

    @classmethod
    def around(
        cls,
        problem: Problem,
        path: Trajectory,
        half_width: tuple[float, float],
        step: tuple[float, float],
        power_step_w: float,
    ) -> Self:
        """Cover a tube around a path."""
        constants = problem.constants
        drift = problem.drift(path.soc[:-1], path.t_cl_degc[:-1])
        return cls(
            Axis.around(
                path.soc, half_width[0], constants.soc_min, constants.soc_max, step[0], drift[0]
            ),
            Axis.around(
                path.t_cl_degc,
                half_width[1],
                constants.t_cl_min_degc,
                constants.t_cl_max_degc,
                step[1],
                drift[1],
            ),
            power_step_w,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Points in SOC and T at one time."""
        return self.soc.points, self.t_cl.points

    @property
    def nodes(self) -> int:
        """Points of the state at one time."""
        return self.soc.points * self.t_cl.points

    def lattice(self, k: int) -> Lattice:
        """Both axes at time k, for compiled code."""
        return Lattice(self.soc.at(k), self.t_cl.at(k))

    def powers_w(self, limits: PowerLimits, states: EngineStates, k: int) -> Floats:
        """Engine powers tried in step k: both ends of the range, and what the ramp leads to."""
        low_w, high_w = float(limits.low_w[k]), float(limits.high_w[k])
        count = max(3, int(np.ceil((high_w - low_w) / self.power_step_w)) + 1)
        even_w: Floats = low_w + np.arange(count) / (count - 1.0) * (high_w - low_w)
        ramped_w = states.most_w[(states.most_w > low_w) & (states.most_w < high_w)]
        return np.union1d(even_w, ramped_w) if len(ramped_w) else even_w
