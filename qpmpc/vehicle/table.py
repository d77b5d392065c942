"""Piecewise-linear lookup in one variable, for one value or for arrays."""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Table:
    """Linear interpolation between points, constant beyond both ends.

    Parameters
    ----------
    x : increasing grid, shape (n,)
    y : values, shape (n,)
    """

    def __init__(self, x: Sequence[float] | NDArray[np.float64], y: ArrayLike) -> None:
        self.x = np.asarray(x, dtype=float)
        self.y = np.asarray(y, dtype=float)
        self._x: list[float] = self.x.tolist()
        self._y: list[float] = self.y.tolist()
        self._slope: list[float] = (np.diff(self.y) / np.diff(self.x)).tolist()

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Interpolate an array of any shape."""
        return np.asarray(np.interp(np.asarray(x, dtype=float), self.x, self.y))

    def at(self, x: float) -> float:
        """Interpolate one value (the plant's fast path: no array is made)."""
        if x <= self._x[0]:
            return self._y[0]
        if x >= self._x[-1]:
            return self._y[-1]
        i = bisect_right(self._x, x) - 1
        return self._y[i] + self._slope[i] * (x - self._x[i])
