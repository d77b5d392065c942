"""One prefix before every name: two controllers in one program, each as it is alone."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from qpmpc.codegen.c_compiler import FLAGS
from qpmpc.codegen.controller import InputBuilder
from qpmpc.codegen.firmware import make_firmware, missing_tools, symbols
from qpmpc.codegen.generate import (
    ALGORITHMS,
    PRECISIONS,
    Algorithm,
    Precision,
    generate,
    project_files,
)
from qpmpc.codegen.host_library import HostLibrary, build_host_library
from qpmpc.codegen.prefix import with_prefix
from qpmpc.codegen.values import Values, values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.errors import InputError
from qpmpc.preview import StageBuilder, Trace
from qpmpc.simulation import simulate
from qpmpc.trip import Observation
from qpmpc.vehicle import load_vehicle

SETTINGS = ControllerSettings()
STEPS = 100


def need(*tools: str) -> None:
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


def numbers(vehicle: str = "prius-nimh") -> Values:
    return values_of(load_vehicle(vehicle), SETTINGS.mh_qp, SETTINGS.rule_based)


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def external(folder: Path, *files: str) -> set[str]:
    """Names with external linkage that the object files define."""
    lines = run(folder, "nm", "-g", "--defined-only", *files).splitlines()
    return {line.split()[-1] for line in lines if re.match(r"^[0-9a-f]+ [A-Z] ", line)}


# --- names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("precision", PRECISIONS)
def test_every_external_name_begins_with_mpc(tmp_path, precision, algorithm) -> None:
    """OSQP's functions keep their names; its workspace, which is ours, does not."""
    need("gcc", "nm")
    generate(numbers(), tmp_path, "host", precision, algorithm)
    ours = [p.name for p in tmp_path.glob("mpc*.c")]
    include = ["-Iosqp", "-Iosqp/inc/public", "-Iosqp/inc/private"]
    if algorithm == "osqp":
        ours.append("osqp/mpc_osqp_workspace.c")
    run(tmp_path, "gcc", "-std=c99", "-c", *include, *ours)
    names = external(tmp_path, *(p.name for p in tmp_path.glob("*.o")))
    assert {"mpc_step", "mpc_forecast_start", "mpc_par"} <= names
    assert [name for name in names if not name.startswith("mpc_")] == []
    # with a prefix of 8 characters they differ within the 31 that C99 promises to keep apart
    if algorithm == "admm":
        assert len({name[: 31 - 8] for name in names}) == len(names)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_public_headers_declare_and_define_nothing_without_mpc(tmp_path, algorithm) -> None:
    """Macros by the preprocessor; types, enumerators and functions from what it leaves."""
    need("gcc")
    generate(numbers(), tmp_path, "host", "f32", algorithm)
    headers = [f"mpc{n}.h" for n in ("", "_config", "_state", "_forecast", "_parts", "_model")]
    everything = "".join(f'#include "{name}"\n' for name in headers)
    (tmp_path / "all.c").write_text("#include <stdint.h>\n" + everything)
    (tmp_path / "none.c").write_text("#include <stdint.h>\n")
    macros = [
        set(re.findall(r"^#define (\w+)", run(tmp_path, "gcc", "-dM", "-E", name), re.MULTILINE))
        for name in ("all.c", "none.c")
    ]
    assert [name for name in macros[0] - macros[1] if not name.startswith("MPC_")] == []
    # what is left of our own files, those that these include among them: not of /usr/include
    parts = re.split(r'^# \d+ "(.*?)".*$', run(tmp_path, "gcc", "-E", "all.c"), flags=re.MULTILINE)
    of_files = zip(parts[1::2], parts[2::2], strict=True)
    code = "".join(text for file, text in of_files if file.startswith("mpc"))
    enumerators = [
        name
        for body in re.findall(r"enum \{(.*?)\}", code, re.DOTALL)
        for name in re.findall(r"(?:^|,)\s*(\w+)", body)
    ]
    types = re.findall(r"^\} (\w+);|^typedef \w+ (\w+);", code, re.MULTILINE)
    functions = re.findall(r"^\w+ \*?(\w+)\(", code, re.MULTILINE)
    assert len(enumerators) > 20
    assert len(types) > 10
    assert len(functions) > 30
    names = [*enumerators, *(a or b for a, b in types), *functions]
    assert [name for name in names if not name.lower().startswith("mpc_")] == []


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("target", ["host", "cortex-m7"])
def test_a_prefix_leaves_no_name_without(target, algorithm) -> None:
    files = project_files(numbers(), target, "f32", algorithm, prefix="liion_")
    for name, text in files.items():
        if not name.startswith(("osqp/src/", "osqp/inc/", "osqp/LICENSE")):
            assert not re.search(r"(\b|-D)(mpc_|MPC_|mpc\.h|libmpc)", name + text), name
    assert "liion_mpc.h" in files
    plain = project_files(numbers(), target, "f32", algorithm)
    without = {re.sub(r"liion_|LIION_", "", n): t for n, t in files.items()}
    assert {n: re.sub(r"liion_|LIION_", "", t) for n, t in without.items()} == plain


def test_no_prefix_changes_nothing() -> None:
    files = {"mpc.h": "mpc_step MPC_SHORT", "osqp/src/a.c": "mpc_"}
    assert with_prefix(files, "") == files


@pytest.mark.parametrize("prefix", ["1a", "_a", "a-b", "a b", "ä_", "a" * 32, "a.b", "a\n", " "])
def test_what_cannot_begin_a_name_is_refused(tmp_path, prefix) -> None:
    with pytest.raises(InputError, match="cannot begin a name in C"):
        generate(numbers(), tmp_path / "out", prefix=prefix)
    assert not (tmp_path / "out").exists()


# --- projects ------------------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_prefixed_project_builds_by_its_makefile_with_its_example(tmp_path, algorithm) -> None:
    need("make", "cc")
    generate(numbers(), tmp_path, "host", "f64", algorithm, "P2_")
    run(tmp_path, "make", "-s", "libP2_mpc.so", "example")
    library = HostLibrary(tmp_path / "libP2_mpc.so", numbers(), "f64", "P2_")
    assert library.state_bytes > 0
    assert run(tmp_path, "./example").count("\n") == 61


@pytest.mark.slow
def test_prefixed_firmware_is_the_same_code(tmp_path) -> None:
    """The flags reach it too: without MPC_NATIVE_MINMAX it would be another, slower one."""
    missing = missing_tools()
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    sections = []
    for prefix in ("", "nimh_"):
        folder = tmp_path / f"of{prefix}"
        generate(numbers(), folder, "cortex-m7", "f32", prefix=prefix)
        elf = make_firmware(folder)
        assert f"{prefix}mpc_step" in symbols(elf)
        run(folder, "arm-none-eabi-objcopy", "-O", "binary", elf.name, "image")
        sections.append((folder / "image").read_bytes())
    assert sections[0] == sections[1]


# --- two controllers in one program --------------------------------------------------------------

# Both headers in one file; the inputs of each are read in turn, a departure before the first step.
BOTH_C = """
#include <stdio.h>
#include "a_mpc_forecast.h"
#include "b_mpc_forecast.h"
static a_mpc_state a_state;
static b_mpc_state b_state;
int main(void)
{
    FILE *const a_file = fopen("a.in", "rb");
    FILE *const b_file = fopen("b.in", "rb");
    FILE *const a_result = fopen("a.out", "wb");
    FILE *const b_result = fopen("b.out", "wb");
    a_mpc_in a_in;
    b_mpc_in b_in;
    a_mpc_out a_out;
    b_mpc_out b_out;
    int departing = 1;
    a_mpc_init(&a_state);
    b_mpc_init(&b_state);
    while ((fread(&a_in, sizeof a_in, 1, a_file) == 1)
           && (fread(&b_in, sizeof b_in, 1, b_file) == 1)) {
        while (departing) {
            departing = (a_mpc_depart(&a_state, &a_in) > 0) | (b_mpc_depart(&b_state, &b_in) > 0);
        }
        (void)a_mpc_step(&a_state, &a_in, &a_out);
        (void)b_mpc_step(&b_state, &b_in, &b_out);
        fwrite(&a_out, sizeof a_out, 1, a_result);
        fwrite(&b_out, sizeof b_out, 1, b_result);
    }
    return fclose(a_result) | fclose(b_result);
}
"""


def recorded(
    vehicle: str, precision: Precision, algorithm: Algorithm = "admm"
) -> tuple[bytes, bytes]:
    """Inputs of the first seconds of NYCC and what the library without a prefix makes of them."""
    car, cycle = load_vehicle(vehicle), load_cycle("nycc")
    trace = Trace.of(cycle, car)
    drove = simulate(cycle, "rule-based", car).trajectory
    library = build_host_library(numbers(vehicle), precision, algorithm)
    inputs = InputBuilder(StageBuilder(car, trace, trace, SETTINGS.mh_qp.horizon).preview)
    state = ctypes.create_string_buffer(library.state_bytes)
    into, out = library.input_type(), library.output_type()
    arguments = state, ctypes.byref(into), ctypes.byref(out)
    library.init(state)
    went_in, came_out = b"", b""
    for k in range(STEPS):
        measured = float(drove.soc[k]), float(drove.t_cl_degc[k]), False
        road = float(trace.demand_w[k]), float(trace.speed_mps[k])
        inputs.fill(Observation(k, *measured, *road), into)
        while k == 0 and library.depart(*arguments[:2]) > 0:
            pass
        library.step(*arguments)
        assert out.flags == 0
        went_in, came_out = went_in + bytes(into), came_out + bytes(out)
    return went_in, came_out


@pytest.mark.slow
@pytest.mark.parametrize(
    "pair",
    [
        (("prius-nimh", "f32"), ("prius-liion", "f64")),
        (("prius-nimh", "f64"), ("prius-liion", "f64")),
        (("prius-nimh", "f32"), ("prius-nimh", "f64")),
    ],
    ids=["two cars in two precisions", "two cars", "one car in two precisions"],
)
def test_two_controllers_in_one_program_are_each_what_they_are_alone(tmp_path, pair) -> None:
    need("cc")
    expected = {}
    for letter, (vehicle, precision) in zip("ab", pair, strict=True):
        generate(numbers(vehicle), tmp_path, "host", precision, prefix=f"{letter}_")
        went_in, expected[letter] = recorded(vehicle, precision)
        (tmp_path / f"{letter}.in").write_bytes(went_in)
    (tmp_path / "both.c").write_text(BOTH_C)
    flags = [f for f in FLAGS.split() if f.startswith(("-O", "-std", "-ff"))]
    sources = [p.name for p in tmp_path.glob("?_mpc_*.c")]
    run(tmp_path, "cc", *flags, "-Wall", "-Werror", "-o", "both", "both.c", *sources, "-lm")
    run(tmp_path, "./both")
    for letter, alone in expected.items():
        assert (tmp_path / f"{letter}.out").read_bytes() == alone


@pytest.mark.slow
def test_two_with_osqp_share_one_copy_of_its_functions(tmp_path) -> None:
    """Of one precision: its workspaces are apart, its functions are the same."""
    need("cc")
    expected = {}
    for letter, vehicle in zip("ab", ("prius-nimh", "prius-liion"), strict=True):
        generate(numbers(vehicle), tmp_path, "host", "f64", "osqp", f"{letter}_")
        went_in, expected[letter] = recorded(vehicle, "f64", "osqp")
        (tmp_path / f"{letter}.in").write_bytes(went_in)
    (tmp_path / "both.c").write_text(BOTH_C)
    sources = [str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*_mpc_*.c")]
    shared = [str(p.relative_to(tmp_path)) for p in tmp_path.glob("osqp/src/*.c")]
    include = ["-Iosqp", "-Iosqp/inc/public", "-Iosqp/inc/private"]
    flags = [f for f in FLAGS.split() if f.startswith(("-O", "-std", "-ff"))]
    run(tmp_path, "cc", *flags, "-w", *include, "-o", "both", "both.c", *sources, *shared, "-lm")
    run(tmp_path, "./both")
    for letter, alone in expected.items():
        assert (tmp_path / f"{letter}.out").read_bytes() == alone
