"""``qpmpc trips``."""

import json
from pathlib import Path

import numpy as np

from qpmpc.cycles import cycle_names, load_cycle
from qpmpc.cycles.trips import make_trip, set_names


def test_table_of_both_sets_beside_the_cycles(cli, tmp_path):
    done = cli("trips", "--json", tmp_path / "trips.json")
    assert done.code == 0
    firsts = [line.split()[0] for line in done.out.splitlines() if line.strip()]
    assert firsts[2:] == [*cycle_names(), *["train"] * 3, *["judge"] * 3]
    table = "\n".join(line.rstrip() for line in done.out.splitlines())
    assert table in (Path(__file__).parents[2] / "docs" / "trips.md").read_text("utf-8")
    data = json.loads((tmp_path / "trips.json").read_text())
    assert len(data["trips"]) == 400
    median = next(r for r in data["sets"] if r["name"] == "judge" and r["quantile"] == "median")
    assert 14 * 60 < median["duration_s"] < 17 * 60


def test_one_trip_with_its_files(cli, tmp_path):
    done = cli("trips", "judge-003", "--out", tmp_path)
    assert done.code == 0
    assert "judge-003" in done.out
    assert (tmp_path / "cycle_judge-003.png").read_bytes().startswith(b"\x89PNG")
    read, trip = load_cycle(tmp_path / "judge-003.csv"), make_trip("judge-003")
    np.testing.assert_array_equal(read.speed_mps, trip.speed_mps)
    np.testing.assert_array_equal(read.grade, trip.grade)
    assert read.remarks == ()


def test_a_random_trip_as_json(cli):
    done = cli("trips", "random-5-600s", "--json", "-")
    assert done.code == 0
    (row,) = json.loads(done.out)["trips"]
    assert row["duration_s"] == 600
    assert row["name"] == "random-5-600s"


def test_a_set_with_its_files(cli, tmp_path):
    done = cli("trips", "train", "--out", tmp_path)
    assert done.code == 0
    files = {file.name for file in tmp_path.iterdir()}
    assert files == {"trips_train.png", *(f"{name}.csv" for name in set_names("train"))}


def test_wrong_names(cli, tmp_path):
    cli("trips", "jdge").assert_refused("train, judge", "judge-000 .. judge-199", "random-SEED")
    cli("trips", "--out", tmp_path).assert_refused("qpmpc trips train")
    cli("simulate", "judge-200").assert_refused("judge-000 .. judge-199", "SECONDS")
