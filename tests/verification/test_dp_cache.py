"""The cache of optima between real processes: one computes, the others wait for it."""

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from qpmpc.cycles import Cycle
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, cache, solve_dp

CYCLE = Cycle.from_samples("steady", np.arange(21), np.full(21, 15.0))
COARSE = DpSettings(soc_step=0.01, t_cl_step_k=2.0, power_step_w=2000.0, refinement=2, threads=1)
PATIENCE_S = 60.0  # on a busy machine, for numba's first compilation
# A process says that it asks, and that it computes; then it goes on when it is told to.
PROGRAM = f"""
import sys, time
from pathlib import Path
import numpy as np
from qpmpc.cycles import Cycle
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp
name, folder = sys.argv[1], Path(sys.argv[2])
reports = 0
def progress(_):
    global reports
    reports += 1
    if reports == 1:
        (folder / f"{{name}}-computes").touch()
        while not (folder / "go").exists(): time.sleep(0.01)
cycle = Cycle.from_samples("steady", np.arange(21), np.full(21, 15.0))
vehicle, grid = load_vehicle(), DpSettings(**{COARSE.model_dump()!r})
(folder / f"{{name}}-asks").touch()
print(repr(solve_dp(cycle, vehicle, grid, progress).fuel_total_g), reports)
"""


@pytest.fixture
def start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))
    processes = []

    def begin(name: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", PROGRAM, name, str(tmp_path)]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


def wait_for(file: Path) -> None:
    end = time.monotonic() + PATIENCE_S
    while not file.exists():
        assert time.monotonic() < end, file.name
        time.sleep(0.01)


def holder_and_waiter(
    start: Callable[[str], subprocess.Popen[str]], folder: Path
) -> tuple[subprocess.Popen[str], subprocess.Popen[str]]:
    """One process in the middle of the work, another one that asks for the same."""
    holder = start("holder")
    wait_for(folder / "holder-computes")
    waiter = start("waiter")
    wait_for(folder / "waiter-asks")
    time.sleep(0.3)  # without the lock it would compute by now
    assert waiter.poll() is None
    assert not (folder / "waiter-computes").exists()
    return holder, waiter


def end_of(process: subprocess.Popen[str]) -> tuple[float, int]:
    fuel, reports = process.communicate(timeout=PATIENCE_S)[0].split()
    return float(fuel), int(reports)


Start = Callable[[str], subprocess.Popen[str]]


def test_two_at_once_compute_once(start: Start, tmp_path: Path) -> None:
    holder, waiter = holder_and_waiter(start, tmp_path)
    (tmp_path / "go").touch()
    computed, taken = end_of(holder), end_of(waiter)
    assert computed[0] == taken[0]
    assert computed[1] > 10
    assert taken[1] == 1  # the one report of a result that is there
    assert len(list(cache.folder().iterdir())) == 1  # and no lock is left


def test_killed_in_the_middle_the_next_one_computes(start: Start, tmp_path: Path) -> None:
    holder, waiter = holder_and_waiter(start, tmp_path)
    holder.kill()
    wait_for(tmp_path / "waiter-computes")
    (tmp_path / "go").touch()
    fuel, reports = end_of(waiter)
    assert fuel == solve_dp(CYCLE, load_vehicle(), COARSE, use_cache=False).fuel_total_g
    assert reports > 10
    assert [path.suffix for path in cache.folder().iterdir()] == [".npz"]


def test_ctrl_c_ends_the_waiting(start: Start, tmp_path: Path) -> None:
    _, waiter = holder_and_waiter(start, tmp_path)
    waiter.send_signal(signal.SIGINT)
    waiter.communicate(timeout=PATIENCE_S)
    assert waiter.returncode == -signal.SIGINT


def test_without_locks_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    key = cache.key(CYCLE, load_vehicle(), COARSE)
    # a folder in the place of the lock can be neither opened nor locked
    (tmp_path / f"dp-{key[:32]}.lock").mkdir()
    assert solve_dp(CYCLE, load_vehicle(), COARSE).admissible
    assert cache.load(key) is not None


def test_the_log_says_what_was_not_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    caplog.set_level(logging.INFO, logger="qpmpc")
    computed = solve_dp(CYCLE, load_vehicle(), COARSE)
    assert "taken from" not in caplog.text
    taken = solve_dp(CYCLE, load_vehicle(), COARSE)
    assert f"optimum of steady taken from {tmp_path}" in caplog.messages
    assert taken.fuel_total_g == computed.fuel_total_g


def test_the_longest_unused_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    solution = solve_dp(CYCLE, load_vehicle(), COARSE, use_cache=False)
    other = tmp_path / "notes.npz"
    other.write_bytes(b"somebody else's")
    for age, name in enumerate("abc"):
        cache.store(name, solution)
        os.utime(tmp_path / f"dp-{name}.npz", (1e9 - age, 1e9 - age))
    size = (tmp_path / "dp-a.npz").stat().st_size
    assert cache.load("c") is not None  # used now
    monkeypatch.setattr(cache, "MOST_BYTES", 2.5 * size)
    cache.store("d", solution)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dp-c.npz", "dp-d.npz", other.name]
