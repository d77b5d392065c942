"""Runs of the engine: counted, measured, and cut off by arrival."""

import numpy as np
import pytest

from qpmpc.engine_runs import ended_runs_s, run_figures
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle

ENGINE = load_vehicle().with_settings({"engine.min_on_s": 4, "engine.start_fuel_g": 0.2}).engine


def seconds(text: str) -> np.ndarray:
    return np.array([c == "#" for c in text])


def test_figures_of_a_trip_by_hand():
    found = run_figures(ENGINE, seconds("..#..####.###.#####..##"), 2.0)
    assert found == {
        "engine_starts_per_km": 2.5,  # the last one counts as a start,
        "engine_on_s": {"min": 1, "median": 3.5},  # but not as a run of two seconds
        "engine_runs_below_3s_share": 0.25,
        "engine_runs_below_min_on_s": 2,
        "fuel_starts_g": pytest.approx(1.0),
    }


@pytest.mark.parametrize(
    ("text", "lengths"), [("", []), ("...", []), ("##", []), ("#.", [1]), ("##.#", [2])]
)
def test_only_runs_that_ended_have_a_length(text, lengths):
    assert ended_runs_s(seconds(text)).tolist() == lengths


def test_without_a_run_that_ended_there_is_no_length():
    found = run_figures(ENGINE, seconds("..###"), 0.0)
    assert found["engine_starts_per_km"] is None  # a car that stood
    assert found["engine_on_s"] == {"min": None, "median": None}
    assert found["engine_runs_below_3s_share"] is None
    assert found["engine_runs_below_min_on_s"] == 0


def test_the_json_of_a_run_agrees_with_its_trajectory():
    settings = {"engine.start_fuel_g": 0.2, "engine.min_on_s": 4}
    run = simulate("nycc", "ecms", settings=settings)
    row, tr = run.summary(), run.trajectory
    assert row["engine_starts_per_km"] == pytest.approx(row["engine_starts"] / run.distance_km)
    assert row["fuel_starts_g"] == pytest.approx(0.2 * row["engine_starts"])
    assert row["friction_brake_j"] == pytest.approx(float(tr.p_friction_w.sum()))
    assert row["engine_on_s"]["min"] >= 4
    begin = list(row).index("engine_starts_per_km")
    assert list(row)[begin : begin + 6] == [
        "engine_starts_per_km",
        "engine_on_s",
        "engine_runs_below_3s_share",
        "engine_runs_below_min_on_s",
        "fuel_starts_g",
        "friction_brake_j",
    ]
