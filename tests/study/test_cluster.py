"""A study on a real Dask cluster: a scheduler and two workers, started by their own commands."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as parquet
import pytest
from pandas.testing import assert_frame_equal
from quick_study import QUICK, as_toml, values

from qpmpc.errors import InputError, QpmpcError
from qpmpc.study.load import as_study, load_study
from qpmpc.study.store import part_files
from qpmpc.study.sweep import sweep

START_S = 60.0


class Cluster:
    """Processes of one scheduler and its workers."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.processes: list[subprocess.Popen[bytes]] = []
        self._start(
            "scheduler", "--port", "0", "--host", "127.0.0.1", "--scheduler-file", self.file
        )
        until = time.monotonic() + START_S
        while not self.file.exists() and time.monotonic() < until:
            time.sleep(0.05)

    def worker(self) -> "subprocess.Popen[bytes]":
        return self._start("worker", "--scheduler-file", self.file, "--nthreads", "1", "--no-nanny")

    def _start(self, kind: str, *options: object) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "distributed.cli.dask_" + kind, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.processes.append(subprocess.Popen([*command, *map(str, options)], **quiet))
        return self.processes[-1]

    @property
    def address(self) -> str:
        return str(json.loads(self.file.read_text())["address"])

    def close(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.close()


@pytest.mark.slow
def test_values_are_those_of_this_machine_even_if_a_worker_is_killed(
    tmp_path: Path, cluster: Cluster
) -> None:
    here = sweep(QUICK, tmp_path / "here", workers=2).folder
    first, _ = cluster.worker(), cluster.worker()
    killed_at = []

    def kill_one(done: int, total: int, failed: int) -> None:
        if done >= 5 and not killed_at:
            first.kill()
            killed_at.append(done)

    there = sweep(QUICK, tmp_path / "there", scheduler=cluster.address, progress=kill_one).folder
    assert killed_at
    every = [n for part in part_files(there) for n in parquet.read_table(part)["run"].to_pylist()]
    assert sorted(every) == list(range(60))  # none lost, none twice
    assert_frame_equal(values(there), values(here), check_exact=True)


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_one_line_and_nothing_is_lost(
    tmp_path: Path, cluster: Cluster
) -> None:
    cluster.worker()

    def kill(done: int, total: int, failed: int) -> None:
        if done == 5:
            cluster.processes[0].kill()

    with pytest.raises(QpmpcError, match="is gone; --resume"):
        sweep(QUICK, tmp_path / "out", scheduler=cluster.address, progress=kill)
    there = len(values(tmp_path / "out"))
    assert 5 <= there < 60
    assert len(values(sweep(QUICK, tmp_path / "out", resume=True, workers=2).folder)) == 60


def test_an_unreachable_scheduler_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qpmpc.study.cluster.REACH_S", 0.5)
    for address in ("tcp://127.0.0.1:9", "no address", "tcp://127.0.0.1"):
        with pytest.raises(InputError, match=r"cannot be reached|is no address") as refused:
            sweep(QUICK, tmp_path / "out", scheduler=address)
        assert "\n" not in str(refused.value)
        assert not (tmp_path / "out").exists()


def test_a_study_file_is_the_same_for_both(tmp_path: Path) -> None:
    assert list(load_study(as_toml(QUICK, tmp_path / "a.toml")).runs()) == list(
        as_study(QUICK).runs()
    )
