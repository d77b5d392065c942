"""``qpmpc simulate --inject``: table, notes, JSON, CSV and picture under faults."""

import csv

import pytest

FAULTS = """
[[fault]]
kind = "nan"
signal = "soc"
at_s = 10
for_s = 3

[[fault]]
kind = "solver-failure"
at_s = 20
for_s = 5
"""


@pytest.fixture
def faults(tmp_path):
    file = tmp_path / "faults.toml"
    file.write_text(FAULTS)
    return file


def test_json_and_notes_say_what_each_fault_did(cli, strict_json, trip, faults):
    done = cli("simulate", trip, "--inject", faults, "--json", "-")
    run = strict_json(done.out)
    sensor, solver = run["faults"]["each"]
    assert (sensor["kind"], sensor["signal"], sensor["at_s"]) == ("nan", "soc", 10)
    assert sensor["drove"]["own decision"] >= 3
    assert sensor["flags"] == {"bad measurement": 3}
    assert solver["flags"]["solver failed"] == 5
    assert solver["drove"]["shifted plan"] >= 3
    assert run["flags"]["bad measurement"] == 3
    assert run["flags"]["solver failed"] == 5
    assert {"fuel_g", "fuel_percent", "met_again_s", "violations"} <= solver.keys()
    notes = [line for line in done.err.splitlines() if line.startswith("fault ")]
    assert len(notes) == 2
    assert "nan of soc at 10 s for 3 s" in notes[0]
    assert "solver failed 5 s" in notes[1]
    assert "all 2 faults together" in done.err


def test_without_faults_flags_are_empty_and_there_are_no_faults(cli, strict_json, trip):
    run = strict_json(cli("simulate", trip, "--json", "-").out)
    assert run["flags"] == {}
    assert "faults" not in run


def test_csv_has_the_rung_and_the_flags_of_each_second(cli, trip, faults, tmp_path):
    assert cli("simulate", trip, "--inject", faults, "--out", tmp_path / "out").code == 0
    with (tmp_path / "out" / "short_mh-qp.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["flags"] for row in rows[10:13]] == ["bad measurement"] * 3
    assert rows[20]["fallback"] == "shifted plan"
    assert rows[20]["flags"] == "solver failed"
    assert {row["flags"] for row in rows[:10]} == {""}
    assert (tmp_path / "out" / "short_mh-qp.png").stat().st_size > 1000


def test_a_bad_file_is_refused_before_the_run(cli, trip, faults, tmp_path):
    faults.write_text(FAULTS.replace("nan", "nun"))
    done = cli("simulate", trip, "--inject", faults, "--out", tmp_path / "out")
    done.assert_refused("faults.toml", "fault 1", "kind", "'nan'")
    cli("simulate", trip, "--inject", "missing.toml").assert_refused("missing.toml")
    faults.write_text(FAULTS.replace("20", "48"))
    cli("simulate", trip, "--inject", faults).assert_refused("fault 2", "at_s", "48")
    assert not (tmp_path / "out").exists()
