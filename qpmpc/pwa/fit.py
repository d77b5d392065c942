"""Minimax convex piecewise-affine (PWA) fits of sampled curves, with proven error bounds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.errors import InputError

BISECTIONS = 40


@dataclass(frozen=True)
class PwaFit:
    """A convex PWA function g(x) = max_i (slope_i x + intercept_i) near a curve f.

    Attributes
    ----------
    slope, intercept : shape (pieces,), slopes increasing
    breakpoints : shape (pieces + 1,), ends of the range and where pieces meet
    below, above : proven bounds on the range: f - below <= g <= f + above
    """

    slope: NDArray[np.float64]
    intercept: NDArray[np.float64]
    breakpoints: NDArray[np.float64]
    below: float
    above: float

    @property
    def pieces(self) -> int:
        """Number of affine pieces."""
        return len(self.slope)

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Evaluate g at an array of any shape."""
        values = np.multiply.outer(np.asarray(x, dtype=float), self.slope) + self.intercept
        return np.asarray(values.max(axis=-1))

    def active_slope(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the slope of the piece that is active at x."""
        inner = np.searchsorted(self.breakpoints[1:-1], x, side="right")
        return self.slope[inner]

    def shifted(self, offset: float) -> "PwaFit":
        """Return g + offset, with its bounds moved along."""
        return PwaFit(
            self.slope,
            self.intercept + offset,
            self.breakpoints,
            self.below - offset,
            self.above + offset,
        )

    def under_estimator(self) -> "PwaFit":
        """Return the highest shift of g that is nowhere above f (above = 0)."""
        return self.shifted(-self.above)

    def over_estimator(self) -> "PwaFit":
        """Return the lowest shift of g that is nowhere below f (below = 0)."""
        return self.shifted(self.below)


def convex_envelope(x: NDArray[np.float64], f: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lower convex envelope of the points (x_i, f_i), on the same grid; shapes (m,).

    Andrew's monotone chain: a point stays only if the slope into it is below the slope out of it.
    """
    at, value = x.tolist(), f.tolist()  # numbers of Python are several times faster here
    hull: list[int] = []
    for i in range(len(at)):
        while len(hull) >= 2:
            a, b = hull[-2], hull[-1]
            rise, run = value[b] - value[a], at[b] - at[a]
            if rise * (at[i] - at[b]) < (value[i] - value[b]) * run:
                break
            hull.pop()
        hull.append(i)
    return np.interp(x, x[hull], f[hull])


def non_convexity(x: NDArray[np.float64], f: NDArray[np.float64]) -> tuple[float, float]:
    """Largest distance of points above their convex envelope, as a share of f > 0, and its x."""
    above = f / convex_envelope(x, f) - 1.0
    at = int(above.argmax())
    return float(max(above[at], 0.0)), float(x[at])


def _tangent_pieces(
    x: NDArray[np.float64], f: NDArray[np.float64], band: NDArray[np.float64]
) -> tuple[list[float], list[float], list[float]]:
    """Cover convex samples with the fewest lines that stay in [f - band, f].

    Each piece starts on the lower edge of the band and is the steepest line that nowhere exceeds
    f; it lasts until it falls out of the band again. Starting as late as possible and reaching as
    far as possible makes the number of pieces minimal.
    """
    slopes, intercepts, starts = [], [], []
    at, value, i = float(x[0]), float(f[0] - band[0]), 0
    while True:
        slope = float(((f[i + 1 :] - value) / (x[i + 1 :] - at)).min())
        slopes.append(slope)
        intercepts.append(value - slope * at)
        starts.append(at)
        touch = i + 1 + int((f[i + 1 :] - slope * x[i + 1 :]).argmin())
        # of the line above the band's edge, from where it touches f
        surplus = band[touch:] - (f[touch:] - (value + slope * (x[touch:] - at)))
        outside = surplus < 0.0
        outside[0] = False
        first = int(outside.argmax())
        if not outside[first]:
            return slopes, intercepts, starts
        j = touch + first
        # The line leaves the band between two samples, where f is linear.
        inside = max(float(surplus[first - 1]), 0.0)
        at = float(x[j - 1] + inside / (inside - surplus[first]) * (x[j] - x[j - 1]))
        value = value + slope * (at - starts[-1])
        i = int(np.searchsorted(x, at, side="right")) - 1
        if i == len(x) - 1:  # only round-off at the last sample was outside
            return slopes, intercepts, starts


def fit_convex(
    x: ArrayLike, f: ArrayLike, tolerance: ArrayLike, interpolation_error: float = 0.0
) -> PwaFit:
    """Fit a convex PWA function with the fewest pieces whose error is at most `tolerance`.

    min_g max_x |g(x) - f_c(x)| / tolerance(x) over convex PWA g with that many pieces, where f_c
    is the lower convex envelope of the samples: first the fewest pieces for the tolerance, then,
    by bisection, the least error with that number. With a constant tolerance this is the minimax
    fit; with a varying one each piece is raised by the error at its middle. The bounds of the
    result refer to f itself.

    Parameters
    ----------
    x, f : samples, shape (m,), x increasing
    tolerance : largest error against the convex envelope, in the unit of f; one or shape (m,)
    interpolation_error : bound on |f - linear interpolation of the samples|; widens the bounds

    Raises
    ------
    InputError
        If there are fewer than three samples, x does not increase or tolerance is not positive.
    """
    x_, f_ = np.asarray(x, dtype=float), np.asarray(f, dtype=float)
    if len(x_) < 3 or len(x_) != len(f_) or np.any(np.diff(x_) <= 0.0):
        raise InputError("a PWA fit needs at least three samples with increasing x")
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=float), x_.shape)
    if not np.all(allowed > 0.0):
        raise InputError(f"a PWA fit needs a positive tolerance (given: {tolerance!r})")
    envelope = convex_envelope(x_, f_)
    pieces = len(_tangent_pieces(x_, envelope, 2.0 * allowed)[0])
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if len(_tangent_pieces(x_, envelope, 2.0 * middle * allowed)[0]) > pieces:
            low = middle
        else:
            high = middle
    slopes, intercepts, starts = _tangent_pieces(x_, envelope, 2.0 * high * allowed)
    slope, ends = np.array(slopes), np.array([*starts, x_[-1]])
    middles = 0.5 * (ends[1:] + ends[:-1])
    intercept = np.array(intercepts) + high * np.interp(middles, x_, allowed)
    meet = -np.diff(intercept) / np.diff(slope)
    unchecked = PwaFit(slope, intercept, np.array([x_[0], *meet, x_[-1]]), 0.0, 0.0)
    for array in (slope, intercept, unchecked.breakpoints):
        array.flags.writeable = False  # a fit is kept and shared
    error = unchecked(x_) - f_
    return PwaFit(
        slope,
        intercept,
        unchecked.breakpoints,
        below=float(max(-error.min(), 0.0)) + interpolation_error,
        above=float(max(error.max(), 0.0)) + interpolation_error,
    )
