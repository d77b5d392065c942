"""How the main measure depends on what a study varies."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kruskal, spearmanr

from qpmpc.report.study.figures import Measure, distinct, groups_of, subjects

if TYPE_CHECKING:
    from pandas import DataFrame

TRIP = ("duration_s", "distance_km", "mean_speed_kmh")
NO_FACTORS = ("seed", "controller")  # a number without a size; a group of its own
FEWEST = 4  # values, for a correlation
PER_CATEGORY = 3  # values, in the mean; with fewer, a category explains anything


def factor_table(
    table: "DataFrame", varied: Sequence[str], columns: Sequence[str], measure: Measure
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the rank correlation of the main measure with each factor, the strongest first.

    Parameters
    ----------
    table : as `study_table` returns it
    varied : columns that the study varies
    columns : that name a group
    measure : the main one

    Returns
    -------
    factors : column, numeric, and for each group its names, n, and `correlation`: Spearman's for
        numbers; for categories the square root of eta² = (H - k + 1) / (n - k), the share of the
        variance of the ranks that k categories explain, with Kruskal's and Wallis' H
    remarks : factors left out, and why
    """
    studied = subjects(table)
    factors, remarks = [], []
    for column in [*(c for c in varied if c not in (*columns, *NO_FACTORS)), *TRIP]:
        if column not in studied or len(distinct(studied, column)) < 2:
            continue
        numeric = is_numeric(studied, column)
        found = []
        for group in groups_of(studied, columns):
            part = group.table[[column, measure.key]].dropna()
            values = part[measure.key].to_numpy(float)
            size = _rank_correlation if numeric else _explained
            found.append({**group.names, "n": len(part), "correlation": size(part[column], values)})
        if all(each["correlation"] is None for each in found):
            remarks.append(
                f"{column}: too few runs per value, or no difference between runs, to tell whether "
                "the main measure depends on it."
            )
        else:
            factors.append({"column": column, "numeric": numeric, "groups": found})
    return sorted(factors, key=_strength, reverse=True), remarks


def is_numeric(table: "DataFrame", column: str) -> bool:
    """Whether all values of a column are numbers."""
    return all(
        isinstance(value, int | float) and not isinstance(value, bool)
        for value in distinct(table, column)
    )


def _strength(factor: dict[str, Any]) -> float:
    return float(max(abs(each["correlation"] or 0.0) for each in factor["groups"]))


def _rank_correlation(factor: Any, values: NDArray[np.float64]) -> float | None:
    numbers = factor.to_numpy(float)
    if len(values) < FEWEST or np.ptp(numbers) == 0.0 or np.ptp(values) == 0.0:
        return None
    return float(spearmanr(numbers, values).statistic)


def _explained(factor: Any, values: NDArray[np.float64]) -> float | None:
    """Return the square root of eta², comparable in size with a correlation."""
    labels = factor.astype(str).to_numpy()
    samples = [values[labels == label] for label in dict.fromkeys(labels)]
    n, k = len(values), len(samples)
    if k < 2 or n < max(FEWEST, PER_CATEGORY * k) or np.ptp(values) == 0.0:
        return None
    share = (kruskal(*samples).statistic - k + 1) / (n - k)
    return float(np.sqrt(max(share, 0.0)))
