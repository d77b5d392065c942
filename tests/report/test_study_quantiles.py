"""Quantiles and means with intervals that hold what they promise."""

import numpy as np
import pytest
from scipy.stats import lognorm

from qpmpc.report.study.figures import ABOVE_DP, SAVING
from qpmpc.report.study.quantiles import (
    FEWEST_FOR_TAIL,
    mean_interval,
    quantile_interval,
    spread,
)

DRAWS, SIZE, SCALE = 200, 120, 0.6


def coverage(interval, truth: float) -> float:
    rng = np.random.default_rng(7)
    found = [interval(rng.lognormal(0.0, SCALE, SIZE)) for _ in range(DRAWS)]
    return float(np.mean([low <= truth <= high for low, high in found]))


@pytest.mark.parametrize("order", [0.5, 0.95])
def test_intervals_of_quantiles_cover_the_truth(order):
    """At least 95 % for any distribution, more since ranks are whole numbers: for 120 values 96.4 %
    (median) and 96.9 % (p95). Of 200 draws, three standard errors are 4 %."""
    truth = float(lognorm(SCALE).ppf(order))
    assert coverage(lambda x: quantile_interval(x, order), truth) >= 0.92


def test_an_interval_of_a_quantile_is_not_needlessly_wide():
    """The ranks of the normal approximation, n p ± 1.96 sqrt(n p (1 - p)), up to one rank."""
    low, high = quantile_interval(np.arange(1.0, 1001.0), 0.5)
    assert low == pytest.approx(500 - 31, abs=1.5)
    assert high == pytest.approx(500 + 32, abs=1.5)


def test_the_interval_of_the_mean_covers_the_truth():
    """Student's t on 120 skewed values: some 94 %, less three standard errors of 200 draws."""
    assert coverage(mean_interval, float(np.exp(SCALE**2 / 2))) >= 0.89


def test_too_few_values_have_no_interval():
    values = np.arange(float(FEWEST_FOR_TAIL))
    assert quantile_interval(values, 0.95) is not None
    assert quantile_interval(values[1:], 0.95) is None
    assert quantile_interval(values[:6], 0.5) is not None
    assert quantile_interval(values[:5], 0.5) is None
    assert mean_interval(values[:1]) is None
    assert quantile_interval(values[:0], 0.5) is None


def test_the_bad_tail_depends_on_the_measure():
    values = np.arange(101.0)
    above, saving = spread(values, ABOVE_DP), spread(values, SAVING)
    assert (above["p95"], above["worst"]) == (95.0, 100.0)
    assert (saving["p05"], saving["worst"]) == (5.0, 0.0)


def test_nothing_and_one_value_and_a_constant():
    nothing = spread(np.array([np.nan, np.inf]), ABOVE_DP)
    assert nothing.pop("n") == 0
    assert set(nothing.values()) == {None}
    one = spread(np.array([np.nan, 2.0]), ABOVE_DP)
    assert (one["n"], one["mean"], one["worst"], one["mean_ci"]) == (1, 2.0, 2.0, None)
    constant = spread(np.full(100, 2.0), ABOVE_DP)
    assert constant["mean_ci"] == constant["median_ci"] == constant["p95_ci"] == [2.0, 2.0]
