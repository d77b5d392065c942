"""Evidence about the C code: compilers, static analysis, MISRA findings, equal work a step."""

import re
from pathlib import Path

import pytest
from c_project import OUTSIDE, build, make_project, need, run, sources

ROOT = Path(__file__).parents[2]
PROGRAMS = [
    "every_command.c", "drive.c", "bytes.c", "promises.c",
    "fuzz_step.c", "bad_memory.c", "two_threads.c", "cold_start.c", "example_main.c",
]  # fmt: skip


@pytest.fixture(
    scope="module", params=["f32 admm", "f64 admm", "f32 osqp", "f64 osqp", "f32 costate"]
)
def project(request, tmp_path_factory) -> Path:
    precision, algorithm = request.param.split()
    folder = tmp_path_factory.mktemp(f"{precision}-{algorithm}")
    make_project(folder, precision, algorithm)
    return folder


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_warning_from_any_compiler(project, compiler) -> None:
    need(compiler)
    flags = "-std=c99 -O2 -Wall -Wextra -Wconversion -Wshadow -Wdouble-promotion -pedantic -Werror"
    built = run(project, compiler, *flags.split(), "-c", *OUTSIDE, *sources(project))
    assert built.returncode == 0, built.stderr


@pytest.mark.parametrize("compiler", ["gcc", "arm-none-eabi-gcc"])
def test_the_compilers_analyzer_finds_nothing(project, compiler) -> None:
    """Null, leaked, uninitialised, out of bounds, infinite recursion: on every path, with -O2."""
    need(compiler)
    host = PROGRAMS if compiler == "gcc" else []
    flags = "-std=gnu99 -O2 -fanalyzer -Wall -Wextra -Werror"
    built = run(project, compiler, *flags.split(), "-c", *OUTSIDE, *sources(project), *host)
    assert built.returncode == 0, built.stderr


# each algorithm and each precision once: a path or a rule hangs on one of them, not on both
ONCE_EACH = pytest.mark.parametrize(
    "project", ["f32 admm", "f64 osqp", "f32 costate"], indirect=True
)


@ONCE_EACH
def test_clangs_analyzer_finds_nothing(project) -> None:
    need("clang")
    checkers = "-analyzer-checker=core,deadcode,nullability,optin,security,unix"
    command = [
        "clang",
        "--analyze",
        "-std=gnu99",
        "-Xclang",
        checkers,
        "-Xclang",
        "-analyzer-werror",
    ]
    found = run(project, *command, *OUTSIDE, *sources(project), *PROGRAMS)
    assert found.returncode == 0, found.stderr
    assert not found.stderr


@pytest.mark.slow
def test_cppcheck_finds_nothing(project) -> None:
    """All severities; only that nothing in these files calls the public functions is no finding."""
    need("cppcheck")
    checked = run(
        project,
        "cppcheck",
        "--std=c99",
        "--enable=all",
        "--inconclusive",
        "--quiet",
        "--suppress=missingIncludeSystem",
        "--suppress=unusedFunction",
        "--suppress=unmatchedSuppression",
        "--suppress=*:osqp/*",
        "--suppress=*:*/osqp/*",
        "--suppress=toomanyconfigs",
        "-UMPC_SOLVER_MAY_SUCCEED",
        "--error-exitcode=1",
        "-Iosqp",
        "-Iosqp/inc/public",
        *sources(project),
    )
    assert checked.returncode == 0, checked.stderr


def deviations() -> set[str]:
    """Rules in the deviations table of the controller's own files."""
    text = (ROOT / "docs" / "misra.md").read_text("utf-8")
    table = text.split("## Controller")[1].split("\n## ")[0]
    return set(re.findall(r"^\| (\d+\.\d+) \|", table, re.MULTILINE))


def own_files(project: Path) -> list[str]:
    """Files that this algorithm alone has or compiles otherwise; none for ADMM, which has all."""
    costate = sorted(p.name for p in project.glob("mpc_costate*.c"))
    osqp = [name for name in sources(project) if "osqp" in (project / name).read_text().lower()]
    return costate or (osqp if (project / "mpc_osqp.c").exists() else [])


CONDITIONAL = ("mpc_step.c", "mpc_forecast.c")  # they include every header whose text depends
OF_A_PART = {"2.3", "2.5"}  # types and macros that the other files use


def misra(project: Path, *given: str) -> set[str]:
    """Rules of the findings in the controller's own files."""
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
        *given,
    )
    found = [line.split()[-1] for line in checked.stderr.splitlines() if line.startswith("mpc")]
    assert found, "the addon reports nothing at all: has it run?"
    return {name.removeprefix("misra-c2012-") for name in found}


@pytest.mark.slow
@ONCE_EACH
def test_misra_findings_are_the_deviations_explained(project) -> None:
    """Files that depend on the build in every configuration, all others in that of the target."""
    need("cppcheck")
    if own := own_files(project):
        rules = misra(project, *own) - OF_A_PART
    else:
        rules = misra(project, "-DMPC_NATIVE_MINMAX", *sources(project))
        rules |= misra(project, *CONDITIONAL) - OF_A_PART
    assert rules <= deviations()


def test_no_step_does_other_work_than_the_next(project) -> None:
    """Instructions of a run of good steps grow by the same number per step (callgrind)."""
    need("gcc", "valgrind")
    (project / "steps.c").write_text(STEPS_C)
    build(project, "gcc", "-std=c99 -O2", "steps", "steps.c")
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
    in.short_rise_j = (mpc_real)40000;
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
            in.long_free_net_w[i] = in.long_net_w[i];
            in.long_free_internal_off_w[i] = in.long_internal_off_w[i];
            in.long_fall_j[i] = (mpc_real)((i * 3251) % 90000);
            in.long_rise_j[i] = (mpc_real)((i * 6133) % 90000);
        }
        if (mpc_step(&state, &in, &out) & ~MPC_WARMING_UP) {
            return 1;
        }
    }
    return 0;
}
"""
