"""The example programs beside a generated controller build, run, and decide as Python does."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from qpmpc.codegen.examples import BOARD_EXAMPLE, HOST_EXAMPLE
from qpmpc.codegen.firmware import ICOUNT_SHIFT, QEMU, missing_tools
from qpmpc.codegen.generate import PRECISIONS, Precision, Target, generate
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.preview import Trace
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle

CAR = load_vehicle()
SETTINGS = ControllerSettings()
HEADING = "time_s,engine_on,p_eng_w,rung,flags"


def need(*tools: str) -> None:
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


def built(
    folder: Path,
    target: Target,
    precision: Precision,
    settings: ControllerSettings = SETTINGS,
    *options: str,
) -> Path:
    """Write a project and build its example by its own Makefile."""
    values = values_of(CAR, settings.mh_qp, settings.rule_based)
    generate(values, folder, target, precision)
    command = ["make", "-s", "-C", str(folder), "example", *options]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return folder


@pytest.fixture(scope="module", params=PRECISIONS)
def host(request, tmp_path_factory) -> tuple[str, Path]:
    need("make", "cc")
    folder = tmp_path_factory.mktemp(f"example-{request.param}")
    return request.param, built(folder, "host", request.param)


def example(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = ["./example", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def commands(text: str) -> np.ndarray:
    lines = text.splitlines()
    assert lines[0] == HEADING
    return np.array([[float(x) for x in line.split(",")] for line in lines[1:]])


def test_the_built_in_trip_is_driven_without_a_fallback(host) -> None:
    run = example(host[1])
    assert (run.returncode, run.stderr) == (0, "")
    time_s, engine_on, p_eng_w, rung, flags = commands(run.stdout).T
    np.testing.assert_array_equal(time_s, np.arange(60))
    assert set(engine_on) == {0.0, 1.0}
    assert (p_eng_w[engine_on == 1.0] >= CAR.engine.power_min_w).all()
    assert not rung.any()
    assert not flags.any()


def test_a_recorded_trip_gets_the_commands_of_the_python_controller(host) -> None:
    """In f64 to what is printed; in f32 power moves by some 100 W on the flat optimum."""
    precision, folder = host
    cycle = load_cycle("nycc")
    trace = Trace.of(cycle, CAR)
    in_python = SETTINGS.with_settings({"mh_qp.implementation": "python"})
    drove = simulate(cycle, "mh-qp", CAR, settings=in_python).trajectory
    rows = [trace.demand_w, trace.speed_mps, drove.soc[:-1], drove.t_cl_degc[:-1]]
    lines = [",".join(repr(float(x)) for x in row) for row in zip(*rows, strict=True)]
    text = "\n".join(["demand_w,speed_mps,soc,t_cl_degc", *lines, ""])
    (folder / "trip.csv").write_text(text)
    run = example(folder, "trip.csv")
    assert (run.returncode, run.stderr) == (0, "")
    _, engine_on, p_eng_w, rung, _ = commands(run.stdout).T
    np.testing.assert_array_equal(engine_on, drove.engine_on)
    assert not rung.any()
    off_by_w = 2e-3 if precision == "f64" else 0.03 * CAR.engine.power_max_w
    np.testing.assert_allclose(p_eng_w, drove.p_eng_w, rtol=0.0, atol=off_by_w)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot be read"),
        ("", "line 2 is not"),
        ("demand_w,speed_mps,soc,t_cl_degc\n", "empty"),
        ("demand_w,speed_mps,soc,t_cl_degc\n1,2,0.6,50\n1,2,x,50\n", "line 3 is not"),
        ("demand_w,speed_mps,soc,t_cl_degc\n1,nan,0.6,50\n", "out of range"),
        ("demand_w,speed_mps,soc,t_cl_degc\n" + 7201 * "1,2,0.6,50\n", "line 7202 is not"),
    ],
)
def test_a_bad_file_is_one_line_and_no_command(host, text, message) -> None:
    _, folder = host
    (folder / "bad.csv").unlink(missing_ok=True)
    if text is not None:
        (folder / "bad.csv").write_text(text)
    run = example(folder, "bad.csv")
    assert (run.returncode, run.stdout) == (1, "")
    assert message in run.stderr
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_host_example_has_no_warning(host, compiler) -> None:
    need(compiler)
    flags = "-std=c99 -O2 -Wall -Wextra -Wconversion -Wshadow -pedantic -Werror -c"
    command = [compiler, *flags.split(), HOST_EXAMPLE]
    checked = subprocess.run(command, cwd=host[1], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize("precision", PRECISIONS)
def test_the_board_example_builds_and_runs_in_qemu(tmp_path, precision) -> None:
    """But for the cycle counter, which QEMU has not: it reads 0. No flag in any second."""
    missing = missing_tools()
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    # a departure of few iterations and seconds that pass quickly
    quick = SETTINGS.with_settings({"mh_qp.admm.cold_iterations": 400})
    core = "CFLAGS=-O3 -DCORE_HZ=100000u"
    folder = built(tmp_path, "cortex-m7", precision, quick, core)
    assert (folder / BOARD_EXAMPLE).exists()
    machine = "-M mps2-an500 -nographic -monitor none -serial none"
    semihosting = "-semihosting-config enable=on,target=native"
    count = f"-icount shift={ICOUNT_SHIFT},sleep=off -kernel example.elf"
    ran = subprocess.run(
        [QEMU, *f"{machine} {semihosting} {count}".split()],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        timeout=120,
        check=False,
    )
    assert ran.returncode == 0
