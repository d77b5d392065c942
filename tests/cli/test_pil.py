"""``qpmpc pil``: one run or the Pareto front, what is written, what is refused."""

import json
import re
import sys
from pathlib import Path

import pytest
from board_log import IDENTITY, bodies, text_of
from browser import assert_works
from pages import assert_self_contained

import qpmpc.codegen.pil.loop as loop
from qpmpc.codegen import firmware
from qpmpc.codegen.firmware import missing_tools
from qpmpc.codegen.pil.pareto import ITERATIONS

MISSING = missing_tools()
needs_tools = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
QUICK = ("--set", "mh_qp.admm.cold_iterations=50")


@needs_tools
def test_one_run_is_reported_and_written(cli, trip, tmp_path):
    out = tmp_path / "out"
    done = cli("pil", trip, *QUICK, "--out", out)
    assert (done.code, done.err) == (0, "")
    assert "48 steps on cortex-m7, f32, algorithm admm, 30 iterations" in done.out
    for word in ("instructions/step", "estimated", "flash", "fuel", "violations", "command"):
        assert word in done.out
    assert {p.name for p in out.iterdir()} == {
        f"pil_short_f32.{ending}" for ending in ("csv", "json", "png", "html")
    }
    rows = (out / "pil_short_f32.csv").read_text().splitlines()
    assert len(rows) == 1 + 48
    html = (out / "pil_short_f32.html").read_text()
    assert_self_contained(html)
    assert "data:image/png;base64," in html
    figures = json.loads((out / "pil_short_f32.json").read_text())
    assert f"{figures['instructions']['median']:,}" in html


@needs_tools
def test_json_on_stdout_is_nothing_but_json(cli, trip, strict_json):
    options = ("--algorithm", "osqp", "--precision", "f64", "--json", "-")
    done = cli("pil", trip, *QUICK, *options)
    assert done.code == 0
    data = strict_json(done.out)
    assert (data["algorithm"], data["precision"], data["steps"]) == ("osqp", "f64", 48)
    assert abs(data["fuel_difference_percent"]) < 0.1
    assert "algorithm osqp" in done.err


@pytest.mark.slow
@needs_tools
def test_pareto_has_every_iteration_count_beside_the_optimum(cli, trip, tmp_path, strict_json):
    pytest.importorskip("numba", reason="not installed: numba, for dynamic programming")
    named = ("--precision", "f32", "--algorithm", "admm")
    done = cli("pil", trip, *QUICK, *named, "--pareto", "--out", tmp_path, "--json", "-")
    assert done.code == 0
    data = strict_json(done.out)
    runs = data["runs"]
    assert [row["iterations"] for row in runs] == list(ITERATIONS)
    counts = [row["instructions"]["median"] for row in runs]
    assert counts == sorted(counts)
    # the work is a constant and a multiple of K
    slopes = [(counts[i + 1] - counts[i]) / (ITERATIONS[i + 1] - ITERATIONS[i]) for i in range(3)]
    assert slopes == pytest.approx([slopes[0]] * 3, rel=0.01)
    for row in runs:
        balanced = row["fuel_soc_balanced_g"]
        above = (balanced / data["dp_fuel_g"] - 1.0) * 100.0
        # the final SOC is at dp's price in one, at eta_eq in the other: on so short a trip 0.2 %
        assert row["fuel_above_dp_percent"] == pytest.approx(above, abs=0.2)
        assert row["fuel_above_dp_percent"] > -0.02  # the optimum's own grid error
    assert json.loads((tmp_path / "pareto_short.json").read_text())["runs"] == runs
    assert (tmp_path / "pareto_short.png").read_bytes().startswith(b"\x89PNG")
    html = (tmp_path / "pareto_short.html").read_text()
    for count in counts:
        assert f"{count:,}" in html
        assert f"{count:,}" in done.err  # the table
    assert_works(tmp_path / "pareto_short.html", charts=2, tables=1)


@needs_tools
@pytest.mark.usefixtures("no_matplotlib")
def test_without_matplotlib_there_are_figures_but_no_picture(cli, trip, tmp_path):
    done = cli("pil", trip, *QUICK, "--out", tmp_path / "out")
    assert done.code == 0
    assert "matplotlib is not installed" in done.out
    names = {p.suffix for p in (tmp_path / "out").iterdir()}
    assert names == {".csv", ".json"}


@pytest.fixture
def project(cli, trip, tmp_path) -> Path:
    """A project for Linux, and a log as its program would write it, but of another machine."""
    folder = tmp_path / "project"
    options = ("--target", "linux", "--seconds", "3", "--controller", "mh-costate")
    done = cli("pil", trip, "--project", folder, *options)
    assert (done.code, done.err) == (0, "")
    identity = re.search("identity ([0-9a-f]{16})", done.out)[1]
    assert f'"{identity}"' in (folder / "replay_identity.h").read_text()
    lines = bodies(3, unit="ns", hz=0)
    lines[0] = lines[0].replace(IDENTITY, identity).replace("mh-qp", "mh-costate")
    off = [body.replace("42c80000,1", "00000000,0") for body in lines]
    (folder / "board.log").write_text(text_of(off), newline="")
    return folder


def test_a_log_is_shown_and_written(cli, project, tmp_path, strict_json):
    out = tmp_path / "out"
    log = project / "board.log"
    done = cli("pil", "--project", project, "--from-log", log, "--out", out, "--json", "-")
    assert done.code == 0, done.err
    data = strict_json(done.out)
    assert data["times"]["step"]["median"] == 1_800_001
    assert data["times"]["step"]["median_ms"] == pytest.approx(1.800001)
    assert data["times"]["step"]["spread_percent"] == pytest.approx(2 / 18000.01)
    assert data["times"]["both"]["max"] == 1_800_002 + 4002
    assert data["commands"]["equal_to_the_bit"] == 3  # standing at first: the engine is off
    for word in ("mpc_step", "1,800,001", "my board", "to the bit", "67,840 B", "0.18"):
        assert word in done.err
    assert {path.name for path in out.iterdir()} == {
        f"board_short_mh-costate_f32.{ending}" for ending in ("csv", "json", "png", "html")
    }


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[:-9], ["line 6", "cut off"]),
        (lambda text: text.replace("1800001", "1800009"), ["line 4 is damaged"]),
        (lambda text: "\x1b[31mno log", ["no line QPMPC1,start"]),
        (lambda text: re.sub(".*step,1.*\n", "", text), ["1 of 3 seconds are missing: 1"]),
        (lambda text: text_of(bodies(3)), ["is of another program", IDENTITY]),
    ],
)
def test_a_bad_log_is_one_line(cli, project, change, words):
    text = (project / "board.log").read_bytes().decode()
    (project / "bad.log").write_text(change(text), newline="")
    cli("pil", "--project", project, "--from-log", project / "bad.log").assert_refused(*words)


def test_commands_that_differ_are_one_line(cli, project):
    log = project / "board.log"
    identity = re.search("start,([0-9a-f]{16})", log.read_text())[1]
    lines = [body.replace(IDENTITY, identity) for body in bodies(3, unit="ns", hz=0)]
    log.write_text(text_of(lines))  # 100 W, where the engine is off
    done = cli("pil", "--project", project, "--from-log", log)
    done.assert_refused("second 0: the board commands 100.0 W, this machine engine off")


@pytest.mark.parametrize(
    ("hz", "options", "milliseconds"),
    [
        (480_000_000, (), 1_800_001 / 480e3),
        (480_000_000, ("--clock-mhz", "240"), 1_800_001 / 240e3),
        (0, ("--clock-mhz", "216"), 1_800_001 / 216e3),
        (0, (), None),
    ],
)
def test_cycles_are_time_by_the_clock(cli, project, strict_json, hz, options, milliseconds):
    log = project / "board.log"
    text = log.read_bytes().decode().replace(",ns,0,", f",cycles,{hz},")
    log.write_text(text_of([body.split("*")[0][7:] for body in text.split("\r\n")[:-1]]))
    done = cli("pil", "--project", project, "--from-log", log, *options, "--json", "-")
    assert done.code == 0, done.err
    data = strict_json(done.out)
    assert data["times"]["step"]["median_ms"] == (milliseconds and pytest.approx(milliseconds))
    assert (data["clock_mhz"] is None) == (milliseconds is None)
    said = "the clock is not known: give --clock-mhz"
    assert (said in done.err) == (said in str(data["remarks"])) == (milliseconds is None)


def test_a_counter_that_stands_still_is_found(cli, project):
    log = project / "board.log"
    text = re.sub(r"(step,\d),\d+,\d+", r"\1,0,0", log.read_bytes().decode())
    log.write_text(text_of([body.split("*")[0][7:] for body in text.split("\r\n")[:-1]]))
    done = cli("pil", "--project", project, "--from-log", log)
    done.assert_refused("every step took 0 ns", "the counter stands still")


def test_a_clock_of_no_effect_is_refused(cli, project):
    log = project / "board.log"
    done = cli("pil", "--project", project, "--from-log", log, "--clock-mhz", "480")
    done.assert_refused("--clock-mhz has no effect: the log counts ns")


@pytest.fixture
def no_run(monkeypatch):
    def run(*_, **__):
        raise AssertionError("bad input must be found before any run")

    monkeypatch.setattr(loop, "processor_in_the_loop", run)
    monkeypatch.setattr("qpmpc.codegen.pil.pareto.processor_in_the_loop", run)


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ([], ["CYCLE", "qpmpc pil --help"]),
        (["nonsense"], ["nonsense", "nycc", "CSV"]),
        (["missing.csv"], ["missing.csv"]),
        (["nycc", "extra"], ["extra"]),
        (["nycc", "--target", "host"], ["host", "cortex-m7"]),
        (["nycc", "--precision", "f16"], ["f16", "f32", "f64"]),
        (["nycc", "--algorithm", "qpoases"], ["qpoases", "admm", "osqp"]),
        (["nycc", "--pareto", "--algorithm", "qpoases"], ["qpoases", "admm", "osqp"]),
        (["nycc", "--pareto=3"], ["--pareto"]),
        (["nycc", "--vehicle", "beetle"], ["beetle", "prius-nimh"]),
        (["nycc", "--set", "x"], ["KEY=VALUE"]),
        (["nycc", "--set", "mh_qp.admm.iterations=0"], ["iterations"]),
        (["nycc", "--set", "mh_qp.admm.relaxation=2.5"], ["relaxation"]),
        (["nycc", "--target", "linux"], ["--target linux", "it needs --project DIR"]),
        (["nycc", "--seconds", "5"], ["--seconds has no effect without --project"]),
        (["nycc", "--clock-mhz", "480"], ["--clock-mhz has no effect"]),
        (["nycc", "--project", "file"], ["--project", "file"]),
        (["nycc", "--project", "new", "--target", "host"], ["host", "cortex-m7, linux"]),
        (["nycc", "--project", "new", "--pareto"], ["--pareto has no effect with --project"]),
        (["nycc", "--project", "new", "--out", "o"], ["--out has no effect with --project"]),
        (["nycc", "--project", "new", "--json", "-"], ["--json has no effect with --project"]),
        (["nycc", "--project", "new", "--seconds", "0"], ["--seconds", "1 to 598"]),
        (["nycc", "--project", "new", "--seconds", "599"], ["--seconds", "1 to 598"]),
        (["nycc", "--project", "new", "--clock-mhz", "480000000"], ["--clock-mhz", "1 to 4000"]),
        (["nycc", "--project", "new", "--clock-mhz", "nan"], ["--clock-mhz", "nan"]),
        (["--from-log", "file"], ["--from-log needs --project"]),
        (["nycc", "--project", "new", "--from-log", "file"], ["CYCLE has no effect"]),
        (["--project", "new", "--from-log", "file", "--seconds", "5"], ["--seconds has no effect"]),
        (["--project", "new", "--from-log", "file"], ["new/replay.toml", "no such file"]),
        (["--project", "new"], ["CYCLE"]),
        (["nycc", "--json", "."], ["--json", "directory"]),
        (["nycc", "--out", "file"], ["--out", "file"]),
        (["nycc", "--pareto", "--out", "file/deeper"], ["--out", "file"]),
    ],
)
@pytest.mark.usefixtures("no_run")
def test_bad_input_is_one_line_and_nothing_is_written(cli, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("not a folder")
    cli("pil", *args).assert_refused(*words)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.usefixtures("no_run")
def test_pareto_without_numba_is_refused(cli, monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    done = cli("pil", "nycc", "--pareto")
    assert done.code == 2
    assert "numba" in done.err


@pytest.mark.usefixtures("no_run")
def test_missing_tools_are_named_with_their_packages(cli, monkeypatch):
    monkeypatch.setattr(firmware.shutil, "which", lambda name: None)
    done = cli("pil", "nycc")
    assert (done.code, done.out) == (1, "")
    assert done.err.count("\n") == 1
    for word in ("arm-none-eabi-gcc", "qemu-system-arm", "apt-get install"):
        assert word in done.err
