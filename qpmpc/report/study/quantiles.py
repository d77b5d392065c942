"""Mean, quantiles and extremes of a figure over many runs, with what chance leaves open."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import quantile_test, t

from qpmpc.report.study.figures import Measure

CONFIDENCE = 0.95
FEWEST_FOR_TAIL = 72  # below, the 95 % interval of a 95th percentile has no upper end

Interval = list[float] | None
Floats = NDArray[np.float64]


def spread(values: Floats, measure: Measure) -> dict[str, Any]:
    """Return the figures of a sample; NaN values are left out.

    Returns
    -------
    n, mean, median, p95 (p05 where a low value is the bad one) and worst, the first three with a
    confidence interval ``mean_ci``, ``median_ci``, ``p95_ci``; None where there are too few values
    """
    finite = values[np.isfinite(values)]
    tail, order = measure.tail
    if len(finite) == 0:
        keys = ("mean", "mean_ci", "median", "median_ci", tail, f"{tail}_ci", "worst")
        return {"n": 0} | dict.fromkeys(keys)
    return {
        "n": len(finite),
        "mean": float(finite.mean()),
        "mean_ci": mean_interval(finite),
        "median": float(np.median(finite)),
        "median_ci": quantile_interval(finite, 0.5),
        tail: float(np.quantile(finite, order)),
        f"{tail}_ci": quantile_interval(finite, order),
        "worst": float(finite.max() if measure.worse == "high" else finite.min()),
    }


def quantile_interval(values: Floats, order: float) -> Interval:
    """Return the interval of a quantile between two of the sorted values, for any distribution.

    P(x_(i) ≤ q < x_(j)) = P(i ≤ B < j) ≥ 0.95,   B binomial with n and the order of q

    None if there are too few values for both ends: 6 for the median, `FEWEST_FOR_TAIL` for p95.
    """
    if len(values) == 0:
        return None
    found = quantile_test(values, p=order).confidence_interval(CONFIDENCE)
    ends = [float(found.low), float(found.high)]
    return ends if np.isfinite(ends).all() else None


def mean_interval(values: Floats) -> Interval:
    """Return the interval of the mean by Student's t; None for fewer than two values."""
    n = len(values)
    if n < 2:
        return None
    half = float(t.ppf(0.5 + CONFIDENCE / 2.0, n - 1) * values.std(ddof=1) / np.sqrt(n))
    mean = float(values.mean())
    return [mean - half, mean + half]
