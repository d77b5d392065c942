"""Evidence about the C code: sanitizers, fuzzing, MISRA findings, equal work a step."""

import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import pytest

from qpmpc.codegen.generate import generate
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.vehicle import load_vehicle

ROOT = Path(__file__).parents[2]
RUNS, SEED = "400", "1"


def need(*tools: str) -> None:
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


@pytest.fixture(scope="module", params=["f32 admm", "f64 admm", "f32 osqp", "f64 osqp"])
def project(request, tmp_path_factory) -> Path:
    precision, solver = request.param.split()
    folder = tmp_path_factory.mktemp(f"{precision}-{solver}")
    settings = ControllerSettings()
    values = values_of(load_vehicle(), settings.mh_qp, settings.rule_based)
    generate(values, folder, "host", precision, solver)
    fuzz = resources.files("qpmpc.codegen") / "fuzz" / "fuzz_step.c"
    (folder / "fuzz_step.c").write_text(fuzz.read_text("utf-8"))
    return folder


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def sources(folder: Path) -> list[str]:
    """Our own files."""
    return sorted(p.name for p in folder.glob("mpc_*.c"))


# OSQP's headers, if it is the solver; their warnings are theirs.
OUTSIDE = ["-isystem", "osqp", "-isystem", "osqp/inc/public", "-Iosqp/inc/private"]


def all_sources(folder: Path) -> list[str]:
    """Our own files and OSQP's, if it is the solver; with where their headers are."""
    osqp = sorted(str(p.relative_to(folder)) for p in folder.glob("osqp/**/*.c"))
    return [*OUTSIDE, *sources(folder), *osqp]


def test_any_bytes_give_a_command_in_range_under_sanitizers(project) -> None:
    need("gcc")
    checks = "address,undefined,float-cast-overflow,float-divide-by-zero"
    flags = f"-std=c99 -O1 -g -DFUZZ_MAIN -fsanitize={checks} -fno-sanitize-recover=all"
    files = ["fuzz_step.c", *all_sources(project)]
    built = run(project, "gcc", *flags.split(), "-o", "fuzz", *files, "-lm")
    assert built.returncode == 0, built.stderr
    fuzzed = run(project, "./fuzz", SEED, RUNS)
    assert fuzzed.returncode == 0, fuzzed.stderr
    assert fuzzed.stdout == f"{RUNS} runs\n"


def test_libfuzzer_finds_nothing_in_a_short_run(project) -> None:
    need("clang")
    flags = "-std=c99 -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all"
    files = ["fuzz_step.c", *all_sources(project)]
    built = run(project, "clang", *flags.split(), "-o", "libfuzz", *files, "-lm")
    if built.returncode and "libclang_rt" in built.stderr:
        pytest.skip("not installed: libFuzzer's run-time library (libclang-rt-dev)")
    assert built.returncode == 0, built.stderr
    fuzzed = run(project, "./libfuzz", "-runs=400", f"-seed={SEED}", "-max_len=512")
    assert fuzzed.returncode == 0, fuzzed.stderr[-2000:]


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_warning_from_any_compiler(project, compiler) -> None:
    need(compiler)
    flags = "-std=c99 -O2 -Wall -Wextra -Wconversion -Wshadow -Wdouble-promotion -pedantic -Werror"
    built = run(project, compiler, *flags.split(), "-c", *OUTSIDE, *sources(project))
    assert built.returncode == 0, built.stderr


def deviations() -> set[str]:
    """Rules in the deviations table of the controller's own files."""
    text = (ROOT / "docs" / "misra.md").read_text("utf-8")
    table = text.split("## Controller")[1].split("\n## ")[0]
    return set(re.findall(r"^\| (\d+\.\d+) \|", table, re.MULTILINE))


def test_misra_findings_are_the_deviations_explained(project) -> None:
    need("cppcheck")
    checked = run(
        project,
        "cppcheck",
        "--std=c99",
        "--addon=misra",
        "--enable=style,warning,performance,portability",
        "--suppress=missingIncludeSystem",
        "--quiet",
        "--template={file}:{line} {id}",
        "-Iosqp",
        "-Iosqp/inc/public",
        *sources(project),
    )
    found = [line.split()[-1] for line in checked.stderr.splitlines() if line.startswith("mpc")]
    rules = {name.removeprefix("misra-c2012-") for name in found}
    assert rules <= deviations(), checked.stderr
    assert found, "the addon reports nothing at all: has it run?"


def test_no_step_does_other_work_than_the_next(project) -> None:
    """Instructions of a run of good steps grow by the same number per step (callgrind)."""
    need("gcc", "valgrind")
    (project / "steps.c").write_text(STEPS_C)
    flags = "-std=c99 -O2 -o steps steps.c"
    assert run(project, "gcc", *flags.split(), *all_sources(project), "-lm").returncode == 0
    counts = [instructions(project, steps) for steps in (20, 21, 22, 40)]
    one = counts[1] - counts[0]
    # x86 has no vminnm: min and max branch or not as the compiler likes; on the target see PIL
    assert counts[2] - counts[1] == pytest.approx(one, rel=0.01)
    assert (counts[3] - counts[2]) / 18 == pytest.approx(one, rel=0.01)


def instructions(folder: Path, steps: int) -> int:
    command = "valgrind --tool=callgrind --callgrind-out-file=/dev/null ./steps"
    result = run(folder, *command.split(), str(steps))
    found = re.search(r"Collected : (\d+)", result.stderr)
    assert found, result.stderr
    return int(found[1])


STEPS_C = """
#include <stdlib.h>
#include <string.h>
#include "mpc.h"
static mpc_state state;
int main(int argc, char **argv)
{
    mpc_in in;
    mpc_out out;
    memset(&in, 0, sizeof in);
    in.soc = (mpc_real)0.6;
    in.t_cl_degc = (mpc_real)50;
    in.short_count = MPC_SHORT;
    mpc_init(&state);
    for (int k = 0; k < atoi(argv[argc - 1]); k++) {
        in.demand_w = (mpc_real)((k * 977) % 20000 - 4000);
        for (int i = 0; i < MPC_SHORT; i++) {
            in.short_demand_w[i] = (mpc_real)(((k + i) * 977) % 20000 - 4000);
        }
        for (int i = 0; i < MPC_LONG; i++) {
            in.long_duration_s[i] = (mpc_real)((i * 13) % 60);
            in.long_net_w[i] = (mpc_real)((i * 7919) % 15000 - 3000);
            in.long_internal_off_w[i] = (mpc_real)1.02 * in.long_net_w[i];
        }
        if (mpc_step(&state, &in, &out) & ~MPC_WARMING_UP) {
            return 1;
        }
    }
    return 0;
}
"""
