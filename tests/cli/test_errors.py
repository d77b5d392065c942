"""Exit codes, and errors as one line that leave nothing behind."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from hostile import limited_disk

from qpmpc.cli import main


def in_place_of_runs(monkeypatch: pytest.MonkeyPatch, function: Callable[..., NoReturn]) -> None:
    monkeypatch.setattr("qpmpc.simulation.drive", function)
    monkeypatch.setattr("qpmpc.comparison.drive", function)


def files(folder: Path) -> dict[str, bytes]:
    return {str(f): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["nonsense"], ["nonsense", "--help"]),
        (["simulate"], ["CYCLE", "qpmpc simulate --help"]),
        (["simulate", "nycc", "--nonsense"], ["--nonsense"]),
        (["simulate", "nycc", "--log-level", "info"], ["--log-level", "before the command"]),
        (["--log-level", "inof", "simulate", "nycc"], ["did you mean 'info'"]),
        (["simulate", "nycc", "extra"], ["extra"]),
        (["simulate", "nonsense"], ["nonsense", "nycc", "CSV"]),
        (["simulate", "missing.csv"], ["missing.csv"]),
        (["simulate", "nycc", "--controller", "pid"], ["pid", "mh-qp", "rule-based", "dp"]),
        (["simulate", "nycc", "--vehicle", "beetle"], ["beetle", "prius-nimh"]),
        (["simulate", "nycc", "--vehicle", "missing.toml"], ["missing.toml"]),
        (["simulate", "nycc", "--set", "x"], ["KEY=VALUE"]),
        (["simulate", "nycc", "--set", "x.y=1"], ["x.y", "thermal", "mh_qp"]),
        (["simulate", "nycc", "--set", "thermal.t_ambient=1"], ["t_ambient", "t_amb_degc"]),
        (["simulate", "nycc", "--set", "thermal.t_amb_degc=warm"], ["t_amb_degc", "warm"]),
        (["simulate", "nycc", "--set", "trip.soc_init=0.9"], ["soc_init"]),
        (["simulate", "nycc", "--set", "mh_qp.admm.iterations=0"], ["iterations"]),
        (["simulate", "nycc", "--set", "mh_qp.admm.iteration=9"], ["iteration", "iterations"]),
        (["simulate", "nycc", "--set", "mh_qp.osqp.iterations=7"], ["mh_qp.admm.iterations"]),
        (["compare", "nycc", "--set", "mh_qp.solver=generated"], ["mh_qp.implementation=c"]),
        (
            ["simulate", "nycc", "--set", "mh_qp.implementation=c", "--set", "mh_qp.solver=piqp"],
            ["mh_qp.solver=piqp"],
        ),
        (
            ["simulate", "nycc", "--set", "mh_qp.solver=piqp", "--set", "mh_qp.admm.iterations=25"],
            ["mh_qp.admm", "mh_qp.solver=piqp"],
        ),
        (
            ["compare", "nycc", "--set", "mh_qp.solver=piqp", "--set", "mh_qp.admm.iterations=25"],
            ["mh_qp.admm", "mh_qp.solver=piqp"],
        ),
        (["simulate", "nycc", "--json", "."], ["--json", "directory"]),
        (["simulate", "nycc", "--json", "file/run.json"], ["--json", "file"]),
        (["simulate", "nycc", "--out", "file"], ["--out", "file"]),
        (["simulate", "nycc", "--out", "file/deeper"], ["--out", "file"]),
        (["compare"], ["CYCLE"]),
        (["compare", "nycc", "nonsense"], ["nonsense"]),
        (["compare", "nycc", "nycc"], ["nycc", "twice"]),
        (["compare", "nycc", "--controllers", "mh-qp,mh-qp"], ["mh-qp", "twice"]),
        (["compare", "nycc", "--controllers", "mh-qp,"], ["''", "rule-based"]),
        (["compare", "nycc", "--out", "file"], ["--out", "file"]),
        (["cycles", "nonsense"], ["nonsense", "nycc"]),
        (["cycles", "--out", "."], ["--out", "name"]),
        (["vehicles", "nonsense"], ["nonsense", "prius-nimh"]),
        (["vehicles", "nycc", "--out", "file"], ["file"]),
        (["vehicles", "--toml"], ["--toml", "name"]),
        (["vehicles", "prius-nimh", "--toml", "--out", "out"], ["--toml", "--out"]),
        (["vehicles", "nonsense", "--toml"], ["nonsense", "prius-nimh"]),
        (["vehicles", "missing.toml", "--toml"], ["missing.toml"]),
        (["simulate", "nycc", "--set", "thermal.t_amb_degc=true"], ["t_amb_degc", "true"]),
        (["simulate", "nycc", "--set", "mh_qp.admm.iterations=true"], ["iterations", "true"]),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(cli, tmp_path, monkeypatch, args, words):
    def no_run(*_, **__):
        raise AssertionError("bad input must be found before any run")

    in_place_of_runs(monkeypatch, no_run)
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("not a folder")
    before = files(tmp_path)
    cli(*args).assert_refused(*words)
    assert files(tmp_path) == before


@pytest.mark.parametrize(
    "rows",
    ["", "time,speed\n0,0\n", "time_s,speed_mps\n0,0\n1,x\n", "time_s,speed_mps\n0,-1\n1,0\n"],
)
def test_bad_trip(cli, tmp_path, rows):
    file = tmp_path / "trip.csv"
    file.write_text(rows)
    cli("simulate", file, "--out", tmp_path / "out").assert_refused("trip.csv")
    assert not (tmp_path / "out").exists()


def test_bad_vehicle_file(cli, trip, tmp_path):
    file = tmp_path / "car.toml"
    file.write_text("name = 'x'\n")
    cli("simulate", trip, "--vehicle", file).assert_refused("car.toml", "chassis", "[trip]")
    cli("vehicles", file, "--toml").assert_refused("car.toml", "chassis")
    file.write_text("base = 'car.toml'\nname = 'x'\n")
    cli("simulate", trip, "--vehicle", file).assert_refused("car.toml", "circle")
    file.write_text("name = = 'x'\n")
    cli("simulate", trip, "--vehicle", file).assert_refused("car.toml", "TOML")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(cli, trip, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    cli("simulate", trip, "--out", folder / "results").assert_refused("permission")


@pytest.mark.parametrize(("name", "package"), [("dp", "numba"), ("mh-nlp", "casadi")])
def test_missing_package_is_found_before_any_run(cli, trip, monkeypatch, name, package):
    monkeypatch.setitem(sys.modules, package, None)
    done = cli("compare", trip, "--controllers", f"mh-qp,{name}")
    done.assert_refused(name, package, "qpmpc-iptm[verification]")


def test_anything_else_is_one_line_and_exit_code_1(cli, trip, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("the first line\nand the second")

    in_place_of_runs(monkeypatch, broken)
    done = cli("simulate", trip, "--out", tmp_path / "out")
    assert (done.code, done.out) == (1, "")
    assert done.err.count("\n") == 1
    assert "RuntimeError: the first line and the second" in done.err
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("QPMPC_DEBUG", "1")
    with pytest.raises(RuntimeError):
        main(["simulate", str(trip)])


def test_full_disk_leaves_no_part_of_a_file(cli, trip, tmp_path):
    file = tmp_path / "run.json"
    with limited_disk(100):
        done = cli("simulate", trip, "--controller", "rule-based", "--json", file)
    assert done.code == 1
    assert done.err == f"qpmpc: {file}: File too large\n"
    assert list(tmp_path.iterdir()) == [trip]


def test_interrupt(cli, trip, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    in_place_of_runs(monkeypatch, interrupted)
    done = cli("simulate", trip)
    assert done.code == 130
    assert done.err == "qpmpc: interrupted\n"


# The signal comes a moment after the drive has begun, however long loading takes.
INTERRUPTED = """
import os, signal, sys, threading, time
# some packages swallow it while they load
import qpmpc.codegen.implementation, qpmpc.simulation
from qpmpc.cli import main

def drives(thread):
    frame = sys._current_frames()[thread.ident]
    while frame is not None and not frame.f_code.co_filename.endswith("closed_loop.py"):
        frame = frame.f_back
    return frame is not None

def interrupt():
    while not drives(threading.main_thread()):
        time.sleep(0.02)
    time.sleep(1.0)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
main(["simulate", "wltc-3b", "--set", "mh_qp.admm.iterations=5000", *sys.argv[1:]])
"""


@pytest.mark.parametrize("implementation", ["python", "c"])
def test_interrupt_reaches_a_run_that_spends_its_time_in_the_solver(tmp_path, implementation):
    """OSQP catches the signal itself and would swallow it."""
    chosen = ["--set", f"mh_qp.implementation={implementation}"]
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, *chosen], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 130
    assert done.stderr.removeprefix("Solver interrupted\n") == "qpmpc: interrupted\n"  # OSQP's
    assert done.stdout == ""


def test_reader_that_leaves_is_no_error(tmp_path):
    """As in `qpmpc vehicles NAME | head -1`."""
    process = subprocess.Popen(
        [sys.executable, "-m", "qpmpc", "vehicles", "prius-nimh"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    )
    assert process.stdout is not None
    process.stdout.close()
    _, err = process.communicate()
    assert err == b""
    assert process.returncode == 0
