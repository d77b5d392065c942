"""OSQP as the generated solver: the same commands as Python's, and a guard for each known trap."""

import ctypes
import math
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.generate import generate, project_files
from qpmpc.codegen.host_library import HostLibrary, compiled
from qpmpc.codegen.osqp_source import matrix_pattern
from qpmpc.codegen.values import Values, values_of
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.errors import InputError
from qpmpc.simulation import simulate
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import load_vehicle

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")

CAR = load_vehicle()
NYCC = load_cycle("nycc")
TRIP = Trip(NYCC, CAR)
SETTINGS = ControllerSettings()
SOLVER_FAILED, WARMING_UP = 4, 8


def numbers(settings: ControllerSettings = SETTINGS, vehicle=CAR) -> Values:
    return values_of(vehicle, settings.mh_qp, settings.rule_based)


def library_of(files: dict[str, str], copy_in: Path | None = None, precision="f64") -> HostLibrary:
    """Load a library; with a folder, a copy of its own with a fresh workspace."""
    file = compiled(files)
    if copy_in is not None:
        file = Path(shutil.copy(file, copy_in))
    return HostLibrary(file, numbers(), precision)


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return project_files(numbers(), "host", "f64", "osqp")


def waiting(library: HostLibrary, trip=TRIP, settings=SETTINGS) -> GeneratedController:
    """Make a controller on a library of ours."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("qpmpc.codegen.controller.build_host_library", lambda *_: library)
        return GeneratedController(trip, settings)


def controller(
    library: HostLibrary, trip=TRIP, settings=SETTINGS, prepared=True
) -> GeneratedController:
    """Make a controller that is initialised and, if prepared, has its first plan."""
    ours = waiting(library, trip, settings.with_settings({"mh_qp.prepared": prepared}))
    ours.begin(trip)
    return ours


def drive(ours, steps: int, reference=None, trip=TRIP):
    """Drive NYCC with the reference's commands, or ours; yields decisions of both."""
    state = trip.plant.initial_state()
    for k in range(steps):
        seen = trip.observation(k, state)
        mine = ours.decide(seen)
        its = reference.decide(seen) if reference else mine
        yield mine, its
        state, _ = trip.plant.step(state, its.command, seen.demand_w, seen.speed_mps)


# The same program, factorised in another order: round-off, as with the solver of our own.
@pytest.mark.slow
def test_double_precision_equals_python_to_the_end_of_the_trip(files) -> None:
    ours = controller(library_of(files))
    reference = MhQp(TRIP)
    for k, (mine, its) in enumerate(drive(ours, TRIP.steps, reference)):
        assert mine.command.engine_on == its.command.engine_on
        assert mine.command.p_eng_w == pytest.approx(its.command.p_eng_w, abs=1e-3)
        assert (mine.fallback, mine.iterations) == (its.fallback, its.iterations)
        if k < 60:
            x, duals = ours.plan()
            plan = reference.planner.last
            assert plan is not None
            scale = np.abs(plan.x).max(axis=0)
            np.testing.assert_allclose(x[:, :6] / scale[:6], plan.x[:, :6] / scale[:6], atol=1e-8)
            np.testing.assert_allclose(duals, plan.duals, atol=1e-8 * np.abs(plan.duals).max())


@pytest.mark.parametrize(
    ("vehicle", "overrides"),
    [
        ("prius-liion", {}),
        ("prius-nimh", {"mh_qp.qp.soc_penalty_g": 400.0}),  # a Hessian that changes
        ("prius-nimh", {"mh_qp.horizon.classes": 1, "mh_qp.horizon.short_stages": 12}),
        ("prius-nimh", {"mh_qp.admm.iterations": 17, "mh_qp.scaling.duration_exponent": 1.0}),
        ("prius-nimh", {"mh_qp.prepared": False}),
    ],
)
def test_other_vehicles_and_settings_equal_python(vehicle, overrides) -> None:
    car, settings = load_vehicle(vehicle), SETTINGS.with_settings(overrides)
    of_car = numbers(settings, car)
    library = HostLibrary(compiled(project_files(of_car, "host", "f64", "osqp")), of_car, "f64")
    trip = Trip(NYCC, car)
    ours = controller(library, trip, settings, settings.mh_qp.prepared)
    for mine, its in drive(ours, 120, MhQp(trip, settings), trip):
        assert mine.command.engine_on == its.command.engine_on
        assert mine.command.p_eng_w == pytest.approx(its.command.p_eng_w, abs=1e-2)
        assert mine.fallback == its.fallback


@pytest.mark.slow
def test_single_precision_burns_the_same_fuel() -> None:
    library = library_of(project_files(numbers(), "host", "f32", "osqp"), precision="f32")
    run = simulate(TRIP, waiting(library))
    python = simulate(TRIP, "mh-qp", settings={"mh_qp.implementation": "python"})
    assert run.fuel_soc_balanced_g == pytest.approx(python.fuel_soc_balanced_g, rel=1e-3)
    assert run.summary()["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
    assert run.summary()["fallback_steps"] == 0


# --- what is generated ---------------------------------------------------------------------------


def test_same_input_gives_the_same_bytes_and_no_date(tmp_path, files) -> None:
    assert project_files(numbers(), "host", "f64", "osqp") == files
    text = "".join(text for name, text in files.items() if not name.startswith("osqp/src"))
    assert not re.search(r"\b\d\d:\d\d:\d\d 20\d\d\b", text)
    assert str(Path.home()) not in text


def test_osqp_comes_unmodified_and_with_its_licence(files) -> None:
    shipped = resources.files("osqp.codegen") / "codegen_src"
    sources = [name for name in files if name.startswith(("osqp/src/", "osqp/inc/"))]
    assert len(sources) > 30
    for name in sources:
        assert files[name] == (shipped / name.removeprefix("osqp/")).read_text("utf-8"), name
    assert "Apache License" in files["osqp/LICENSE"]
    assert "osqp/LICENSE" in files["NOTICE"]
    assert "mpc_admm.c" not in files


def test_generated_project_builds_by_its_makefile(tmp_path, files) -> None:
    if shutil.which("make") is None:
        pytest.skip("not installed: make")
    generate(numbers(), tmp_path, "host", "f64", "osqp")
    result = subprocess.run(
        ["make", "-s", "-C", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert HostLibrary(tmp_path / "libmpc.so", numbers(), "f64").state_bytes > 0


# Where starts take fuel, five entries more: three in their row, its bound, heat in the coolant's
# row. The first stage has none before it: SOC, coolant and, for starts, the on-share.
@pytest.mark.parametrize(("car", "more", "first"), [("paper-nimh", 0, 2), ("prius-nimh", 5, 3)])
def test_pattern_has_the_entries_that_the_adapter_counts(car, more, first) -> None:
    values = numbers(vehicle=load_vehicle(car))
    sizes = values.sizes
    pieces = sizes.fuel_pieces + sizes.battery_pieces
    assert matrix_pattern(values).nnz == sizes.stages * (3 * pieces + 21 + more) - first


def test_numbers_too_small_for_what_osqp_generates_are_refused() -> None:
    # printed with 20 decimals, sigma would be another number in C than in Python, or 0
    settings = SETTINGS.with_settings({"mh_qp.admm.proximal_weight": 1.2345678e-17})
    with pytest.raises(InputError, match=r"mh_qp\.admm\.proximal_weight"):
        project_files(numbers(settings), "host", "f64", "osqp")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MODE 2", "MODE 1", "updates of matrices"),
        ("MODE 2", "MODE 2\n#define OSQP_ENABLE_PRINTING", "without input and output"),
        ("MODE 2", "MODE 2\n#define OSQP_ENABLE_INTERRUPT", "without input and output"),
        ("MODE 2", "MODE 2\n#define OSQP_ENABLE_PROFILING", "time limit"),
        ("MODE 2", "MODE 2\n#define OSQP_USE_FLOAT", "different precisions"),
    ],
)
def test_osqp_generated_otherwise_does_not_compile(tmp_path, files, old, new, message) -> None:
    generate(numbers(), tmp_path, "host", "f64", "osqp")
    check = [compiler() or "cc", "-fsyntax-only", "-Iosqp", "-Iosqp/inc/public", "mpc_osqp.c"]

    def compile_it() -> subprocess.CompletedProcess[str]:
        return subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert compile_it().returncode == 0
    configuration = tmp_path / "osqp" / "osqp_configure.h"
    text = configuration.read_text()
    assert old in text
    configuration.write_text(text.replace(old, new))
    result = compile_it()
    assert result.returncode != 0
    assert message in result.stderr


# --- what goes wrong inside OSQP -----------------------------------------------------------------

# Stands between the adapter and OSQP and spoils what comes back. 100 + status: what OSQP does on
# that status, with 2.14e9, its "not a number", in the solution.
PROBE_C = """
#include <math.h>
#include "osqp.h"
#include "mpc_osqp_workspace.h"
int probe_fault = 0;
enum { SOLVE = 1, NOT_A_NUMBER = 2, MATRICES = 3, VECTORS = 4, CROSSED = 5 };
OSQPInt probed_solve(OSQPSolver *s)
{
    const OSQPInt result = osqp_solve(s);
    if (probe_fault >= 100) {
        s->info->status_val = probe_fault - 100;
        for (int i = 0; (i < 10) && (probe_fault > 102) && (probe_fault != 107); i++) {
            s->solution->x[i] = OSQP_NAN;
        }
    }
    if (probe_fault == NOT_A_NUMBER) {
        s->solution->y[3] = (OSQPFloat)NAN;
    }
    return (probe_fault == SOLVE) ? 1 : result;
}
OSQPInt probed_mat(OSQPSolver *s, const OSQPFloat *p, const OSQPInt *pi, OSQPInt pn,
                   const OSQPFloat *a, const OSQPInt *ai, OSQPInt an)
{
    const OSQPInt result = osqp_update_data_mat(s, p, pi, pn, a, ai, an);
    return (probe_fault == MATRICES) ? 1 : result;
}
OSQPInt probed_vec(OSQPSolver *s, const OSQPFloat *q, const OSQPFloat *l, const OSQPFloat *u)
{
    const int crossed = (probe_fault == CROSSED);
    const OSQPInt result = osqp_update_data_vec(s, q, crossed ? u : l, crossed ? l : u);
    return (probe_fault == VECTORS) ? 1 : result;
}
void probe_set(int scaling, int adaptive_rho, int check)
{
    mpc_osqp_solver.settings->scaling = scaling;
    mpc_osqp_solver.settings->adaptive_rho = adaptive_rho;
    mpc_osqp_solver.settings->check_termination = check;
}
"""
PROBED = {
    "osqp_solve": "probed_solve",
    "osqp_update_data_mat": "probed_mat",
    "osqp_update_data_vec": "probed_vec",
}


@pytest.fixture
def probed(files, tmp_path) -> tuple[HostLibrary, ctypes.c_int]:
    adapter = files["mpc_osqp.c"]
    for name, probe in PROBED.items():
        assert f"{name}(" in adapter
        adapter = re.sub(rf"\b{name}\(", f"{probe}(", adapter)
    first = adapter.index("enum {")
    declared = (
        "OSQPInt probed_solve(OSQPSolver *s);\n"
        "OSQPInt probed_mat(OSQPSolver *s, const OSQPFloat *p, const OSQPInt *pi, OSQPInt pn,\n"
        "                   const OSQPFloat *a, const OSQPInt *ai, OSQPInt an);\n"
        "OSQPInt probed_vec(OSQPSolver *, const OSQPFloat *, const OSQPFloat *,\n"
        "                   const OSQPFloat *);\n"
    )
    adapter = adapter[:first] + declared + adapter[first:]
    library = library_of(files | {"mpc_osqp.c": adapter, "probe.c": PROBE_C}, tmp_path)
    return library, ctypes.c_int.in_dll(library.functions, "probe_fault")


STATUSES = {  # osqp_api_constants.h
    "solved": (1, True),
    "solved inaccurate": (2, True),
    "primal infeasible": (3, False),
    "primal infeasible inaccurate": (4, False),
    "dual infeasible": (5, False),
    "dual infeasible inaccurate": (6, False),
    "maximum iterations": (7, True),
    "time limit": (8, False),
    "non convex": (9, False),
    "interrupted": (10, False),
    "unsolved": (11, False),
}
FAULTS = {
    "solve returns an error": (1, False),
    "not a number": (2, False),
    "matrices refused": (3, False),
    "vectors refused": (4, False),
    "lower bound above upper": (5, False),
    **{f"status {name}": (100 + code, fine) for name, (code, fine) in STATUSES.items()},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_failure_inside_osqp_is_noticed_and_leaves_nothing_behind(probed, fault) -> None:
    library, probe_fault = probed
    code, is_fine = FAULTS[fault]
    ours = controller(library)
    reference = MhQp(TRIP)
    seen = []
    for k, (mine, its) in enumerate(drive(ours, 14, reference)):
        if k not in (10, 11):  # spoilt, and the one that starts from an older iterate
            assert mine.command.p_eng_w == pytest.approx(its.command.p_eng_w, abs=1.0)
        seen.append((ours._out.flags, mine.fallback))
        assert math.isfinite(mine.command.p_eng_w)
        probe_fault.value = code if k == 9 else 0  # in step 10
    bad = (0, "") if is_fine else (SOLVER_FAILED, "shifted plan")
    assert seen == [(0, "")] * 10 + [bad] + [(0, "")] * 3


@pytest.mark.parametrize(
    "changed", [(10, 0, 0), (0, 1, 0), (0, 0, 25)], ids=["scaling", "adaptive rho", "termination"]
)
def test_settings_that_change_the_work_or_the_problem_are_refused(probed, changed) -> None:
    library, _ = probed
    ours = controller(library)
    assert next(drive(ours, 1))[0].fallback == ""
    library.functions.probe_set(*changed)
    # the drive begins again: its first second has been before
    flags = [ours._out.flags & ~Flag.BAD_CLOCK for _ in drive(ours, 3)]
    assert flags == [SOLVER_FAILED] * 3
    library.functions.probe_set(0, 0, 0)


def test_nothing_of_another_trip_or_of_a_nan_is_left_in_the_workspace(files, tmp_path) -> None:
    """A fresh workspace and a much used, once poisoned one give the same bits."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    fresh, used = (library_of(files, tmp_path / name) for name in "ab")
    other = controller(used, prepared=False)
    list(drive(other, 40))
    size, stages = used.state_bytes, used.values.sizes.stages
    stage_bytes = (size // stages) // 8 * 8
    ctypes.memset(ctypes.byref(other._state, 2 * stage_bytes), 0xFF, stage_bytes)
    other.decide(Observation(41, 0.6, 50.0, False, 5000.0, 10.0))
    assert other._out.flags == SOLVER_FAILED
    for mine, its in zip(
        drive(controller(fresh, prepared=False), 60),
        drive(controller(used, prepared=False), 60),
        strict=True,
    ):
        np.testing.assert_equal(mine, its)  # not a number equals itself here


# --- one instance --------------------------------------------------------------------------------


def test_the_last_controller_initialised_has_the_solver_and_the_others_are_told(files) -> None:
    library = library_of(files)
    first = controller(library)
    steps = drive(first, 12)
    alone = [next(steps) for _ in range(4)]
    assert first._out.flags == 0
    second = controller(library)  # initialised while the first is under way
    others = drive(second, 8)
    for _ in range(4):
        mine, _ = next(steps)
        assert first._out.flags & SOLVER_FAILED
        assert mine.fallback in ("shifted plan", "rule-based")
        assert math.isfinite(mine.command.p_eng_w)
        next(others)
        assert second._out.flags == 0
    library.init(first._state)  # and back again
    again = [mine for mine, _ in drive(first, 6)]
    assert [mine.fallback for mine in again] == ["rule-based"] * 4 + [""] * 2
    next(others)
    assert second._out.flags == SOLVER_FAILED
    assert len(alone) == 4


def test_a_departure_taken_over_by_another_controller_ends_and_the_rules_drive(files) -> None:
    library = library_of(files)
    first = controller(library, prepared=False)
    at = (CAR.trip.soc_init, CAR.trip.t_cl_init_degc, False)
    first.inputs.fill(Observation(0, *at, 0.0, 0.0), first._in)
    for _ in range(3):
        assert library.depart(first._state, ctypes.byref(first._in)) == 1
    controller(library, prepared=False)
    assert library.depart(first._state, ctypes.byref(first._in)) == 0
    fallbacks = [mine.fallback for mine, _ in drive(first, 7)]
    assert fallbacks == ["rule-based"] * 7
    assert first._out.flags == SOLVER_FAILED
