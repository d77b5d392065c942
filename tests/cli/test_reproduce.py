"""``qpmpc reproduce``: refused before any time is spent, and one quick run of all of it."""

import json
from dataclasses import replace

import pytest

from qpmpc.cycles import Cycle
from qpmpc.verification.reproduction import Extent


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["--vehicle", "tractor"], ["tractor"]),
        (["--set", "thermal.t_amb_degc=warm"], ["t_amb_degc"]),
        (["--set", "baseline_mpc.horizon=20"], ["horizon", "horizon_s"]),
    ],
)
def test_bad_input_is_refused_in_one_line_and_leaves_nothing(cli, tmp_path, args, words):
    done = cli("reproduce", "--quick", "--out", tmp_path / "out", *args)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert all(word in done.err for word in words)
    assert not list(tmp_path.iterdir())


def test_a_file_is_no_folder_for_the_report(cli, tmp_path):
    file = tmp_path / "out"
    file.write_text("mine")
    done = cli("reproduce", "--quick", "--out", file)
    assert done.code == 2
    assert "--out" in done.err
    assert file.read_text() == "mine"


@pytest.mark.usefixtures("no_matplotlib")
def test_without_the_plot_extra_it_says_what_to_install(cli, tmp_path):
    done = cli("reproduce", "--quick", "--out", tmp_path / "out")
    assert done.code == 2
    assert "matplotlib" in done.err
    assert "pip install" in done.err


@pytest.mark.slow
def test_the_other_car_on_a_mild_day(cli, tmp_path, monkeypatch, strict_json):
    """The first seconds are enough for the way in and out; `verification` has the quick run."""
    quick = Extent.quick()
    minutes = tuple(
        Cycle(cycle.name, cycle.time_s[:37], cycle.speed_mps[:37], cycle.grade[:37])
        for cycle in quick.cycles
    )
    monkeypatch.setattr(Extent, "quick", lambda: replace(quick, cycles=minutes))
    out, data = tmp_path / "out", tmp_path / "data.json"
    done = cli(
        *("reproduce", "--quick", "--out", out, "--json", data),
        *("--vehicle", "paper-liion", "--set", "thermal.t_amb_degc=10"),
    )
    assert done.code == 0, done.err
    found = strict_json(data.read_text("utf-8"))
    assert found["vehicle"] == "paper-liion"
    assert found["t_amb_degc"] == 10.0
    assert found == json.loads((out / "reproduction.json").read_text("utf-8"))
    for check in found["checks"]:
        assert check["name"] in done.out
    assert not any(any(run["violations"].values()) for run in found["runs"])
