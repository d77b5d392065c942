"""A drive cycle: speed and grade over time on a uniform 1 s grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.errors import InputError

Floats = NDArray[np.float64]

TIME_ROUNDING_S = 1e-6


def _frozen(values: ArrayLike) -> Floats:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Cycle:
    """Speed ``v[k]`` and grade ``g[k]`` at the times ``t[k] = k``, ``k = 0..n``, in seconds.

    Step ``k`` leads from ``t[k]`` to ``t[k+1]`` at constant acceleration, so that

        step speed         (v[k] + v[k+1]) / 2
        step acceleration   v[k+1] - v[k]
        distance            sum of the step speeds, times 1 s

    A drive may start and end at speed. The arrays are read-only copies.

    Parameters
    ----------
    name
        A shipped name, or the stem of the file it came from.
    time_s
        0, 1, .., n. Shape (n+1,).
    speed_mps
        Vehicle speed, not negative, m/s. Shape (n+1,).
    grade
        Rise over run, dimensionless, positive uphill. Shape (n+1,).
    remarks
        What a user should know about it, one line each: unusual values, for example.

    Raises
    ------
    InputError
        If the arrays differ in shape, have values that are not finite or negative speeds, or the
        grid differs.
    """

    name: str
    time_s: Floats
    speed_mps: Floats
    grade: Floats
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in ("time_s", "speed_mps", "grade"):
            array = _frozen(getattr(self, field))
            if array.ndim != 1 or not np.all(np.isfinite(array)):
                raise InputError(f"cycle {self.name}: {field} must be a finite vector")
            object.__setattr__(self, field, array)
        points = len(self.time_s)
        if points < 2 or not np.array_equal(self.time_s, np.arange(points)):
            raise InputError(f"cycle {self.name}: time_s must be 0, 1, 2, .., at least 2 points")
        if not len(self.speed_mps) == len(self.grade) == points:
            raise InputError(f"cycle {self.name}: time_s, speed_mps and grade differ in length")
        if np.any(self.speed_mps < 0):
            raise InputError(f"cycle {self.name}: speed_mps must not be negative")

    @classmethod
    def from_samples(
        cls,
        name: str,
        time_s: ArrayLike,
        speed_mps: ArrayLike,
        grade: ArrayLike | None = None,
    ) -> Self:
        """Interpolate samples linearly at 0, 1, 2, .. seconds after the first one.

        The part after the last whole second is dropped.

        Parameters
        ----------
        name
            Name of the cycle.
        time_s
            Strictly increasing, any spacing, any origin, s. Shape (m,).
        speed_mps
            Speed at these times, m/s. Shape (m,).
        grade
            Rise over run at these times; a level road if absent. Shape (m,).

        Raises
        ------
        InputError
            If the samples have unequal shapes, span less than 1 s, or time does not increase.
        """
        time = np.asarray(time_s, dtype=np.float64)
        speed = np.asarray(speed_mps, dtype=np.float64)
        slope = np.zeros_like(time) if grade is None else np.asarray(grade, dtype=np.float64)
        if time.ndim != 1 or not time.shape == speed.shape == slope.shape:
            raise InputError(f"cycle {name}: time_s, speed_mps and grade differ in shape")
        # "not all greater" also refuses NaN
        if len(time) < 2 or not np.all(np.diff(time) > 0):
            raise InputError(f"cycle {name}: time_s must increase, over at least 2 samples")
        elapsed = time - time[0]
        grid = np.arange(np.floor(elapsed[-1] + TIME_ROUNDING_S) + 1.0)
        return cls(
            name=name,
            time_s=grid,
            speed_mps=np.interp(grid, elapsed, speed),
            grade=np.interp(grid, elapsed, slope),
        )

    @property
    def steps(self) -> int:
        """Number n of steps of 1 s."""
        return len(self.time_s) - 1

    @property
    def duration_s(self) -> float:
        """Time from the first point to the last, s."""
        return float(self.time_s[-1])

    @property
    def distance_m(self) -> float:
        """Sum of the step speeds times 1 s (trapezoidal rule), m."""
        return float(np.sum(self.step_speed_mps))

    @cached_property
    def step_speed_mps(self) -> Floats:
        """Mean of the speeds at both ends of each step, m/s. Shape (n,)."""
        return _frozen((self.speed_mps[:-1] + self.speed_mps[1:]) / 2)

    @cached_property
    def step_accel_mps2(self) -> Floats:
        """Change of speed over each step of 1 s, m/s^2. Shape (n,)."""
        return _frozen(np.diff(self.speed_mps))

    @cached_property
    def step_grade(self) -> Floats:
        """Mean of the grades at both ends of each step, rise over run. Shape (n,)."""
        return _frozen((self.grade[:-1] + self.grade[1:]) / 2)
