"""Grids of the state: the whole admissible box, or a tube around a path."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from qpmpc.verification.dynamic_programming.kernels import Floats, Lattice
from qpmpc.verification.dynamic_programming.problem import Problem
from qpmpc.verification.dynamic_programming.trajectory import Trajectory


@dataclass(frozen=True)
class Axis:
    """Nodes lowest + spacing * (offset_k + 0 .. points-1) at the times k = 0..n.

    All offsets refer to one lattice from the lower to the upper limit, so that the limits are
    nodes.

    Attributes
    ----------
    lowest, spacing : the lattice
    lattice_points : nodes from limit to limit
    points : nodes at one time
    offset : first node at each time, shape (n+1,)
    """

    lowest: float
    spacing: float
    lattice_points: int
    points: int
    offset: NDArray[np.int64]

    @classmethod
    def full(cls, low: float, high: float, spacing: float, times: int) -> Self:
        """Cover low..high at all times with cells of at most `spacing`."""
        cells = max(2, int(np.ceil((high - low) / spacing - 1e-9)))
        return cls(low, (high - low) / cells, cells + 1, cells + 1, np.zeros(times, dtype=np.int64))

    @classmethod
    def around(
        cls, path: Floats, half_width: float, low: float, high: float, spacing: float
    ) -> Self:
        """Cover the path by at least +-half_width at all times, cut at low and high."""
        whole = cls.full(low, high, spacing, len(path))
        points = min(2 * int(np.ceil(half_width / whole.spacing)) + 1, whole.points)
        centre = np.rint((path - low) / whole.spacing).astype(np.int64)
        offset = np.clip(centre - points // 2, 0, whole.points - points)
        return cls(low, whole.spacing, whole.points, points, offset)

    def origin(self, k: int) -> float:
        """Lowest node at time k."""
        return self.lowest + self.spacing * float(self.offset[k])

    def nodes(self, k: int) -> Floats:
        """All nodes at time k, shape (points,)."""
        nodes: Floats = self.lowest + self.spacing * (self.offset[k] + np.arange(self.points))
        return nodes

    def clearance(self, path: Floats) -> float:
        """Least distance of a path from those edges that are not limits, in half widths."""
        position = (path - self.lowest) / self.spacing - self.offset
        half = 0.5 * (self.points - 1)
        lower = np.where(self.offset > 0, position, half)
        top = self.lattice_points - self.points
        upper = np.where(self.offset < top, self.points - 1 - position, half)
        return float(min(lower.min(), upper.min()) / half)


@dataclass(frozen=True)
class Grid:
    """SOC and coolant axes, and the spacing of the engine power."""

    soc: Axis
    t_cl: Axis
    power_step_w: float

    @classmethod
    def full(
        cls, problem: Problem, soc_step: float, t_cl_step_k: float, power_step_w: float
    ) -> Self:
        """Cover everything within the limits."""
        constants, times = problem.constants, problem.steps + 1
        return cls(
            Axis.full(constants.soc_min, constants.soc_max, soc_step, times),
            Axis.full(constants.t_cl_min_degc, constants.t_cl_max_degc, t_cl_step_k, times),
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
        return cls(
            Axis.around(path.soc, half_width[0], constants.soc_min, constants.soc_max, step[0]),
            Axis.around(
                path.t_cl_degc,
                half_width[1],
                constants.t_cl_min_degc,
                constants.t_cl_max_degc,
                step[1],
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
        """Corner and cell size at time k."""
        return Lattice(self.soc.origin(k), self.soc.spacing, self.t_cl.origin(k), self.t_cl.spacing)

    def power_count(self, problem: Problem, k: int) -> int:
        """Number of engine powers tried in step k, both ends of the range included."""
        span = problem.power_high_w[k] - problem.power_low_w[k]
        return max(3, int(np.ceil(span / self.power_step_w)) + 1)
