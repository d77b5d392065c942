"""Final SOC at the price that dynamic programming found, wherever it drove the same trip."""

import pytest

import qpmpc
from qpmpc.report.columns import notes


@pytest.fixture(scope="module")
def runs():
    # rules without balance end off their SOC, which is what a price is for
    settings = {"dp.grid": "quick", "rule_based.balance": False, "rule_based.soc_ref_offset": 0.005}
    return qpmpc.compare("nycc", ["rule-based", "mh-qp", "dp"], settings=settings)


def test_all_runs_of_a_cycle_are_balanced_at_the_price_of_dp(runs):
    price = runs[-1].soc_price_g
    assert 250.0 < price < 400.0  # g of fuel for a whole battery of 1.4 kWh
    rows = runs.rows()
    for run, row in zip(runs, rows, strict=True):
        missing = 0.6 - float(run.trajectory.soc[-1])
        assert row["fuel_soc_balanced_dp_g"] == pytest.approx(run.fuel_g + price * missing)
    rules, mpc, dp = (row["fuel_soc_balanced_dp_g"] for row in rows)
    assert rows[0]["fuel_above_dp_percent"] == pytest.approx(100.0 * (rules / dp - 1.0))
    assert rows[1]["saving_vs_rule_percent"] == pytest.approx(100.0 * (1.0 - mpc / rules))
    assert abs(rows[0]["soc_end"] - 0.6) > 1e-3  # else nothing was tested
    assert rows[0]["fuel_soc_balanced_dp_g"] != rows[0]["fuel_soc_balanced_g"]


def test_the_table_says_the_price_and_shows_that_fuel(runs):
    assert f"{runs[-1].soc_price_g:.1f} on nycc" in " ".join(notes(runs.rows()))
    assert f"{runs.rows()[0]['fuel_soc_balanced_dp_g']:.1f}" in str(runs)


def test_without_dp_the_efficiency_of_the_trip_prices_it(runs):
    for row in runs[:2].rows():
        assert row["fuel_soc_balanced_dp_g"] is None
        assert row["soc_price_g"] is None


def test_a_study_uses_the_same_price(tmp_path):
    study = {
        "name": "price",
        "fixed": {"cycle": "nycc", "dp.grid": "quick"},
        "grid": {"controller": ["rule-based", "dp"]},
    }
    rules, dp = qpmpc.sweep(study, tmp_path / "out", workers=1).frame().itertuples()
    missing = rules.soc_end_target - rules.soc_end
    assert abs(missing) > 1e-3  # else nothing was tested
    fuel_g = rules.fuel_g + dp.soc_price_g * missing
    dp_g = dp.fuel_g + dp.soc_price_g * (dp.soc_end_target - dp.soc_end)
    assert rules.fuel_above_dp_percent == pytest.approx(100.0 * (fuel_g / dp_g - 1.0))
