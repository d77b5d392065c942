"""Studies: their files, and the parameters of their runs."""

import time
from collections import Counter
from datetime import date
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.errors import InputError
from qpmpc.study.inputs import read_inputs
from qpmpc.study.load import as_study, load_study, shipped_studies

SMALL: dict[str, Any] = {"name": "small", "fixed": {"cycle": "nycc"}}


def study(**tables: Any) -> Any:
    return as_study({**SMALL, **tables})


def test_a_grid_is_all_combinations() -> None:
    made = study(grid={"vehicle": ["prius-nimh", "prius-liion"], "thermal.t_amb_degc": [-15, 0, 5]})
    runs = list(made.runs())
    assert [run.run for run in runs] == list(range(6))
    assert made.count == 6
    found = {(run.vehicle, run.settings["thermal.t_amb_degc"]) for run in runs}
    assert found == {(v, t) for v in ("prius-nimh", "prius-liion") for t in (-15, 0, 5)}


def test_dotted_names_need_no_quotes(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text(
        'name = "a"\n[fixed]\ncycle = "nycc"\ntrip.soc_init = 0.5\n[grid]\n'
        "thermal.t_amb_degc = [-7, 0]\n[sample]\ncount = 2\n"
        "values.thermal.cabin_heat_w = {uniform = [500, 4000]}\n"
    )
    made = load_study(file)
    assert made.settings == ("trip.soc_init", "thermal.cabin_heat_w", "thermal.t_amb_degc")


def test_a_setting_without_effect_makes_no_further_run() -> None:
    """The optimum does not depend on the controller's iterations, nor the rules on a forecast."""
    made = study(
        grid={
            "controller": ["mh-qp", "rule-based", "dp"],
            "mh_qp.admm.iterations": [10, 25, 50],
            "forecast": ["true", "shift"],
        }
    )
    runs = list(made.runs())
    assert Counter(run.controller for run in runs) == {"mh-qp": 6, "rule-based": 1, "dp": 1}
    assert next(run for run in runs if run.controller == "dp").settings == {}
    assert made.count == len(runs)


def test_keys_without_effect_on_any_controller_are_named() -> None:
    made = study(
        fixed={
            "cycle": "nycc",
            "controller": "rule-based",
            "ecms.factor": 2.0,
            "trip.soc_init": 0.5,
        },
        grid={"forecast": ["true", "shift"], "rule_based.on_w": [6e3, 8e3]},
    )
    assert set(made.idle) == {"ecms.factor", "forecast"}
    assert made.count == 2


def test_points_that_a_controller_cannot_tell_apart_are_run_once() -> None:
    made = study(
        grid={"controller": ["mh-qp", "dp"]},
        points=[{"mh_qp.admm.iterations": 10}, {"mh_qp.admm.rho": 0.3}, {"thermal.t_amb_degc": 0}],
    )
    found = [(run.controller, run.settings) for run in made.runs()]
    assert found == [
        ("mh-qp", {"mh_qp.admm.iterations": 10}),
        ("dp", {}),
        ("mh-qp", {"mh_qp.admm.rho": 0.3}),
        ("mh-qp", {"thermal.t_amb_degc": 0}),
        ("dp", {"thermal.t_amb_degc": 0}),
    ]


def test_samples_have_their_seed_and_do_not_depend_on_their_number() -> None:
    values = {"thermal.t_amb_degc": {"uniform": [-15, 10]}, "vehicle": {"choice": ["a", "b"]}}
    few, many = (
        list(study(seed=5, sample={"count": count, "values": values}).runs()) for count in (3, 10)
    )
    assert many[:3] == few
    assert [run.seed for run in many] == list(range(5, 15))
    assert len({run.settings["thermal.t_amb_degc"] for run in many}) == 10


@settings(deadline=None)  # the first one imports scipy
@given(st.integers(2, 40), st.integers(0, 1000))
def test_a_latin_hypercube_has_one_sample_in_each_stratum(count: int, seed: int) -> None:
    values = {"trip.soc_init": {"uniform": [0.4, 0.8]}, "thermal.t_amb_degc": {"uniform": [0, 1]}}
    sample = {"count": count, "method": "latin-hypercube", "values": values}
    runs = list(study(seed=seed, sample=sample).runs())
    for key, low, high in (("trip.soc_init", 0.4, 0.8), ("thermal.t_amb_degc", 0.0, 1.0)):
        strata = sorted(int((r.settings[key] - low) / (high - low) * count) for r in runs)
        assert strata == list(range(count))


def test_each_takes_one_after_the_other() -> None:
    made = as_study(
        {"name": "a", "sample": {"count": 5, "values": {"cycle": {"each": ["nycc", "udds"]}}}}
    )
    assert [run.cycle for run in made.runs()] == ["nycc", "udds", "nycc", "udds", "nycc"]


def test_a_set_stands_for_its_trips_and_a_random_trip_gets_the_seed() -> None:
    assert as_study({"name": "a", "grid": {"cycle": ["judge", "nycc"]}}).count == 201
    seeds = {"grid": {"seed": [7, 8]}, "fixed": {"cycle": "random-600s"}}
    runs = as_study({"name": "a", **seeds}).runs()
    assert [run.cycle for run in runs] == ["random-7-600s", "random-8-600s"]


def test_what_python_has_more_than_toml_is_taken() -> None:
    made = as_study(
        {
            "name": "a",
            "fixed": {"cycle": Path("my.csv"), "trip.soc_init": np.float64(0.5)},
            "grid": {"seed": range(2), "thermal.t_amb_degc": np.arange(2), "vehicle": ("a", "b")},
        }
    )
    runs = list(made.runs())
    assert (runs[0].cycle, runs[-1].seed, len(runs)) == ("my.csv", 1, 8)
    assert runs[-1].settings == {"trip.soc_init": 0.5, "thermal.t_amb_degc": 1}


def test_many_points_take_no_long_time() -> None:
    """Comparing each with each in every sample would take hours."""
    made = study(
        points=[{"trip.soc_init": 0.4 + 1e-4 * i} for i in range(1000)],
        sample={"count": 20, "values": {"thermal.t_amb_degc": {"uniform": [-15, 10]}}},
    )
    before = time.process_time()
    assert made.count == 20_000
    assert time.process_time() - before < 5.0


def test_files_are_looked_for_from_the_folder_of_the_study(tmp_path: Path) -> None:
    trip = tmp_path / "my.csv"
    trip.write_text("time_s,speed_mps\n" + "".join(f"{t},{min(t, 5)}\n" for t in range(30)))
    (tmp_path / "a.toml").write_text('name = "a"\n[grid]\ncycle = ["my.csv", "nycc"]\n')
    made = load_study(tmp_path / "a.toml")
    assert [run.cycle for run in made.runs()] == [str(trip), "nycc"]
    assert list(read_inputs(made).cycles) == [str(trip)]


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"grid": {"cycle": ["udds"]}}, "cycle is in fixed and in grid"),
        ({"fixed": {}}, "no cycle"),
        ({"fixed": {"cycle": "nycc", "wheels": 4}}, "unknown key 'wheels'"),
        ({"grid": {"vehicle": ["a", "a"]}}, "a value twice"),
        ({"grid": {"thermal.t_amb_degc": [1, "cold"]}}, "several kinds"),
        ({"grid": {"thermal.t_amb_degc": []}}, "at least 1"),
        ({"grid": {"vehicle": [1]}}, "vehicle must be text"),
        ({"grid": {"seed": [-1]}}, "seed must be an integer, 0 or more"),
        ({"name": "../up"}, "name"),
        ({"name": "a", "colour": 1}, "unknown colour"),
        ({"sample": {"count": 2, "values": {"trip.soc_init": {"uniform": [1, 0]}}}}, "least, most"),
        ({"sample": {"count": 2, "values": {"trip.soc_init": {}}}}, "must be one of"),
        ({"sample": {"count": 0, "values": {"seed": {"choice": [1]}}}}, "greater than"),
        (
            {"grid": {"seed": list(range(1001)), "thermal.x": list(range(1000))}},
            "at most",
        ),
        ({"fixed": {}, "points": [{"cycle": "nycc"}, {"seed": 1}]}, "no cycle in point 2"),
        ({"fixed": {"cycle": "train"}}, "set of trips: give it in grid"),
        ({"points": [{"thermal.t_amb_degc": 1}, {"thermal.t_amb_degc": True}]}, "several kinds"),
        ({"grid": {"rule_based.balance": [True, 1]}}, "several kinds"),
        ({"grid": {"thermal.t_amb_degc": [1, 1.0]}}, "a value twice"),
        ({"grid": {"rule_based.on_w": [2**63]}}, "64 bits"),
        ({"grid": {"thermal.t_amb_degc": 1, "thermal": {"t_amb_degc": 2}}}, "given twice"),
        ({"grid": {"trip.soc_init": [[0.5]]}}, "finite number, a text, true or false$"),
        ({"grid": {"trip.soc_init": [date(2020, 1, 1)]}}, "finite number, a text, true or false$"),
        ({"grid": {"trip.soc_init": [float("nan")]}}, "finite number"),
        ({"grid": {3: [1]}}, "unknown key '3'"),
        (
            {"seed": 2**31 - 1, "sample": {"count": 2, "values": {"vehicle": {"choice": ["a"]}}}},
            "seed [+] count",
        ),
    ],
)
def test_a_wrong_study_is_refused_in_one_line(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        study(**tables)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"fixed": {"cycle": "nyc"}}, "nycc"),
        ({"fixed": {"cycle": "judge-200"}}, "judge-199"),
        ({"grid": {"vehicle": ["prius-nimh", "prius"]}}, "prius"),
        ({"grid": {"controller": ["mh-qp", "mpc"]}}, "controller"),
        ({"grid": {"forecast": ["true", "shifted"]}}, "shift"),
        ({"grid": {"thermal.t_amb_degc": [0, 500]}}, "t_amb_degc"),
        ({"grid": {"mh_qp.admm.iterations": [10, 0]}}, "iterations"),
        ({"grid": {"mh_qp.admm.iteration": [10]}}, "iterations"),
        ({"grid": {"faults": ["none.toml"]}}, "no such file"),
    ],
)
def test_what_it_names_is_checked_before_the_first_run(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        read_inputs(study(**tables))
    assert "\n" not in str(refused.value)


def test_the_values_of_a_point_are_checked_together() -> None:
    """The window of one point would be none with an end of the other."""
    windows = [(0.3, 0.4), (0.6, 0.7)]
    points = [
        {"battery.soc_min": low, "battery.soc_max": high, "trip.soc_init": (low + high) / 2}
        for low, high in windows
    ]
    read_inputs(study(points=points))
    with pytest.raises(InputError, match="soc_m"):
        read_inputs(study(points=[*points, {"battery.soc_min": 0.9, "battery.soc_max": 0.8}]))


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_can_be_run(name: str) -> None:
    made = load_study(name)
    assert made.name == name
    assert made.description
    read_inputs(made)
    assert [run.run for run in islice(made.runs(), 3)] == [0, 1, 2]


def test_what_was_assumed_about_a_log_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "said_by_a_study.csv"
    log.write_text("t_s,speed_kmh\n" + "".join(f"{k},{3 * k}\n" for k in range(9)))
    read_inputs(study(fixed={"cycle": str(log), "controller": "rule-based"}))
    assert f"{log}: speed from 'speed_kmh', in kmh" in caplog.messages


def test_an_unknown_study_is_refused() -> None:
    with pytest.raises(InputError, match="weather"):
        load_study("weathr")
