"""Draws that are the same for years: numpy promises raw words of PCG64, not `Generator.normal`."""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles.cycle import Floats

T = TypeVar("T")
_WORD_SHIFT, _WORD_UNIT = 11, 2.0**-53  # a double has 53 bits


class Draws:
    """A stream of random numbers, given by a sequence of integers."""

    def __init__(self, *key: int) -> None:
        self._words = np.random.PCG64(list(key))

    def uniforms(self, count: int) -> Floats:
        """Numbers in [0, 1). Shape (count,)."""
        words: NDArray[np.uint64] = self._words.random_raw(count)
        return (words >> np.uint64(_WORD_SHIFT)).astype(np.float64) * _WORD_UNIT

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """A number in [low, high)."""
        return low + (high - low) * ((int(self._words.random_raw()) >> _WORD_SHIFT) * _WORD_UNIT)

    def integer(self, count: int) -> int:
        """One of 0 .. count - 1."""
        return int(self.uniform() * count)

    def choice(self, values: Sequence[T]) -> T:
        """One of the values."""
        return values[self.integer(len(values))]

    def normals(self, count: int) -> Floats:
        """Standard normal numbers, by Box and Muller. Shape (count,)."""
        half = (count + 1) // 2
        radius = np.sqrt(-2.0 * np.log1p(-self.uniforms(half)))
        angle = 2.0 * np.pi * self.uniforms(half)
        return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)])[:count]

    def lognormal(self, median: float, spread: float) -> float:
        """A number of which the logarithm is normal with the standard deviation `spread`."""
        return median * math.exp(spread * float(self.normals(1)[0]))

    def permutation(self, count: int) -> list[int]:
        """0 .. count - 1 in random order, by Fisher and Yates."""
        order = list(range(count))
        for i in range(count - 1, 0, -1):
            j = self.integer(i + 1)
            order[i], order[j] = order[j], order[i]
        return order
