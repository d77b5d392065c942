"""A reader in a process of its own: what it says arrives, and a crash ends one file's reading."""

import ctypes
import os
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal

from qpmpc.cycles import load_cycle
from qpmpc.cycles.logs.apart import read_apart
from qpmpc.errors import InputError

TIME_S = np.arange(0.0, 60.05, 0.1)


@pytest.fixture
def log(tmp_path):
    with MDF(version="4.10") as file:
        file.append([Signal(np.minimum(TIME_S, 60.0 - TIME_S), TIME_S, name="VehSpd", unit="m/s")])
        file.save(tmp_path / "a.mf4")
    return tmp_path / "a.mf4"


def test_a_crash_is_one_line_and_the_next_file_is_read(log):
    for _ in range(2):
        with pytest.raises(InputError, match=r"^1: it crashes what reads it: SIG(SEGV|BUS)$"):
            read_apart(ctypes.string_at, 1, 8)  # reads eight bytes at address 1
        assert load_cycle(log).speed_mps.max() == pytest.approx(30.0)


def test_a_reader_that_ends_its_process_is_one_line():
    with pytest.raises(InputError, match="crashes what reads it: exit code 3"):
        read_apart(_ExitWith(), Path("a.mf4"), None)


class _ExitWith:
    """Pickled as a call of `os._exit`."""

    def __reduce__(self):
        return os._exit, (3,)


def test_a_path_relative_to_where_the_caller_is_now(log, monkeypatch):
    load_cycle(log)  # the process of its own is there, and elsewhere
    monkeypatch.chdir(log.parent)
    assert load_cycle(Path("a.mf4")).speed_mps.max() == pytest.approx(30.0)


def test_a_copy_of_the_process_reads_with_a_process_of_its_own(log):
    load_cycle(log)
    pid = os.fork()
    if pid == 0:
        os._exit(0 if load_cycle(log).speed_mps.max() > 29.0 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    assert load_cycle(log).speed_mps.max() == pytest.approx(30.0)
