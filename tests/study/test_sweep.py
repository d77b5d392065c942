"""Whole studies in real processes: values, failures, kill and Ctrl-C."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as parquet
import pytest
from pandas.testing import assert_frame_equal
from quick_study import QUICK, as_toml, values

import qpmpc
from qpmpc.names import Shipped
from qpmpc.registry import CONTROLLERS
from qpmpc.study.columns import columns
from qpmpc.study.inputs import Inputs
from qpmpc.study.load import as_study
from qpmpc.study.run import row_of
from qpmpc.study.store import JOURNAL, part_files
from qpmpc.study.sweep import sweep

KILLS = int(os.environ.get("QPMPC_KILLS", "3"))  # of a study, at random moments
QPMPC = [sys.executable, "-m", "qpmpc"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study without interruption."""
    folder = tmp_path_factory.mktemp("whole") / "out"
    sweep(QUICK, folder, workers=2)
    return folder


def test_a_run_of_a_study_is_that_of_simulate(whole: Path) -> None:
    frame = values(whole)
    assert frame["error"].isna().all()
    assert frame["run"].tolist() == list(range(60))
    row = frame.iloc[37]
    settings = {k.removeprefix("set."): row[k] for k in frame if k.startswith("set.")}
    run = qpmpc.simulate(row["cycle"], row["controller"], row["vehicle"], settings=settings)
    assert run.fuel_g == row["fuel_g"]
    assert run.summary()["violations"]["t_cl_degc"] == row["violations.t_cl_degc"]


def test_every_figure_of_a_run_has_a_column(whole: Path) -> None:
    from qpmpc.study.columns import flat

    known = columns(as_study({"name": "a", "fixed": {"cycle": "nycc"}}))
    broken = [{"kind": "nan", "signal": "soc", "at_s": 50, "for_s": 3}]
    found = flat(qpmpc.simulate("nycc", "mh-qp", faults=broken).summary())
    assert any(key.startswith("flags.") for key in found)
    assert {key for key in found if not key.startswith("faults.")} <= set(known)
    table = parquet.read_table(part_files(whole)[0])
    assert set(table.column_names) >= set(known)


def test_failures_are_recorded_and_the_others_go_on(tmp_path: Path) -> None:
    """Dynamic programming refuses a start below the coolant limit; the rules do not."""
    study = {
        "name": "cold",
        "fixed": {"cycle": "nycc", "dp.soc_step": 0.02, "dp.t_cl_step_k": 5, "dp.refinement": 1},
        "grid": {"controller": ["dp", "rule-based"], "trip.t_cl_init_degc": [30, 50]},
    }
    frame = values(sweep(study, tmp_path / "out", workers=1).folder)
    assert frame["error"].notna().tolist() == [True, False, False, False]
    assert "t_cl_init_degc" in frame["error"][0]
    assert frame["fuel_g"].isna().tolist() == [True, False, False, False]


class Leaving(qpmpc.Controller):
    name = "leaving"
    error: BaseException

    def step(self, seen: qpmpc.Observation) -> qpmpc.Command:
        raise self.error


@pytest.mark.parametrize("error", [SystemExit(3), KeyboardInterrupt(), MemoryError()])
def test_a_controller_that_leaves_is_a_run_that_failed(
    monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    monkeypatch.setitem(CONTROLLERS.shipped, "leaving", Shipped(f"{__name__}:Leaving"))
    monkeypatch.setattr(Leaving, "error", error, raising=False)
    (run,) = as_study({"name": "a", "fixed": {"cycle": "nycc", "controller": "leaving"}}).runs()
    row, made = row_of(run, Inputs())
    assert made is None
    assert row["error"].startswith(type(error).__name__)


def test_trajectories_are_kept_on_request(tmp_path: Path) -> None:
    study = {
        "name": "a",
        "trajectories": True,
        "fixed": {"cycle": "nycc", "controller": "rule-based", "rule_based.balance": False},
    }
    results = sweep(study, tmp_path / "out", workers=1)
    table = parquet.read_table(tmp_path / "out" / "trajectories" / "run-0000000.parquet")
    fuel_g = results.frame()["fuel_g"][0]
    assert sum(f for f in table["fuel_g"].to_pylist() if f) == pytest.approx(fuel_g, rel=1e-12)


def started(file: Path, folder: Path, **more: Any) -> "subprocess.Popen[str]":
    command = [*QPMPC, "sweep", str(file), "--out", str(folder), "--resume"]
    return subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **more
    )


def wait_for(condition: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    until = time.monotonic() + 60.0
    while not condition() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)


def finished(folder: Path) -> int:
    """Runs on disk, seen from outside."""
    rows = sum(parquet.read_metadata(file).num_rows for file in part_files(folder))
    journal = folder / JOURNAL
    return rows + (journal.read_bytes().count(b"\n") if journal.exists() else 0)


@pytest.mark.slow
def test_killed_again_and_again_and_gone_on_with_it_is_the_same_study(
    tmp_path: Path, whole: Path
) -> None:
    file, folder = as_toml(QUICK, tmp_path / "study.toml"), tmp_path / "out"
    draw = random.Random(12)
    for _ in range(KILLS):
        before = finished(folder) if folder.exists() else 0
        process = started(file, folder)
        some = draw.randint(1, 5)
        wait_for(lambda n=before + some: folder.exists() and finished(folder) >= n, process)
        time.sleep(draw.random() * 0.05)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert finished(folder) >= before
    process = started(file, folder)
    assert "Traceback" not in process.communicate()[1]
    assert process.returncode == 0
    every = [n for part in part_files(folder) for n in parquet.read_table(part)["run"].to_pylist()]
    assert sorted(every) == list(range(60))  # none lost, none twice
    assert_frame_equal(values(folder), values(whole), check_exact=True)


def test_ctrl_c_ends_it_with_all_that_was_finished(tmp_path: Path) -> None:
    file, folder = as_toml(QUICK, tmp_path / "study.toml"), tmp_path / "out"
    process = started(file, folder, start_new_session=True)
    wait_for(lambda: folder.exists() and finished(folder) >= 3, process)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
    said = process.communicate(timeout=20)[1]
    assert said == "qpmpc: interrupted\n"
    assert process.returncode == 130
    assert not (folder / JOURNAL).exists()
    assert 3 <= finished(folder) < 60
    assert values(folder)["error"].isna().all()


@pytest.mark.slow
def test_a_full_disk_is_one_line(tmp_path: Path) -> None:
    """A limit of the size of files gives the same error from the kernel as a disk that is full.

    The rows of the 60 runs exceed it, and a part (24 kB, most of it names of columns) does not.
    """
    file, folder = as_toml(QUICK, tmp_path / "study.toml"), tmp_path / "out"

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

    process = started(file, folder, preexec_fn=limited)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert said.count("\n") == 1
    assert JOURNAL in said
    there = finished(folder)
    assert there > 0
    again = started(file, folder)
    again.communicate(timeout=60)
    assert again.returncode == 0
    assert finished(folder) == 60
