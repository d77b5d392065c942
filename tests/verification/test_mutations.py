"""Every check can fail: break an ingredient, and the quick checks notice.

A mutation replaces a piece of source text, which must occur exactly once, in a function of the
product or in its table of rows. The test then runs the quick checks that should notice on a fresh
context; the mutation is caught if one of them fails.
"""

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import qpmpc.codegen.values
import qpmpc.controllers.qp_planner
import qpmpc.preview.forecast
import qpmpc.preview.stages
import qpmpc.pwa.model
import qpmpc.qp.stage_qp
import qpmpc.vehicle.heat
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.preview.forecast import Trace
from qpmpc.preview.stages import StageBuilder
from qpmpc.qp import rows
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.scaling import Scaling
from qpmpc.qp.stage_qp import StageQp
from qpmpc.qp.structure import QpStructure
from qpmpc.registry import CHECKS
from qpmpc.solvers.forms import OneSided
from qpmpc.solvers.osqp import Osqp
from qpmpc.solvers.qoco import Qoco
from qpmpc.trip import Trip
from qpmpc.vehicle import Plant, load_vehicle
from qpmpc.vehicle.engine import OptimalLine, optimal_line
from qpmpc.verification.checks import (
    Context,
    Group,
    backend_checks,
    nlp_checks,
    physics_checks,
    rendering_checks,
    run_checks,
)
from qpmpc.verification.checks.backend_checks import common_problems
from qpmpc.verification.checks.balance_checks import books_balance, limits_kept
from qpmpc.verification.checks.bound_checks import bound_below_everything
from qpmpc.verification.checks.nlp_checks import (
    against_the_nonlinear_program,
    plans_beside_the_nonlinear_program,
)
from qpmpc.verification.checks.physics_checks import (
    constant_demand,
    engine_covers_demand,
    thermostat_exact,
)
from qpmpc.verification.checks.pwa_checks import bounds_hold, trip_error_small
from qpmpc.verification.checks.qp_checks import (
    same_optimum,
    scaling_is_neutral,
    stages_agree,
    warm_start_shifted,
)
from qpmpc.verification.checks.relaxation_checks import expansion_small, relaxation_tight
from qpmpc.verification.checks.rendering_checks import one_qp
from qpmpc.verification.nonlinear.solver import NlpSolver
from qpmpc.verification.renderings import generated_qp

pytestmark = pytest.mark.slow

# What is broken is not in the starts, and its engine is the fastest to check.
CAR = "paper-nimh"


@dataclass(frozen=True)
class Replacement:
    """`old` becomes `new` in the function `name` of `owner`."""

    owner: Any
    name: str
    old: str
    new: str


@dataclass(frozen=True)
class Mutation:
    """`old` becomes `new` in the function `name` of `owner`; `checks` should notice.

    `noticed` are beginnings of names of checks that must be among those that fail; without any,
    one is enough. `also` is replaced too, where what is broken is written in two places.
    """

    title: str
    owner: Any
    name: str
    old: str
    new: str
    checks: tuple[Callable[..., Any], ...]
    noticed: tuple[str, ...] = ()
    also: Replacement | None = None


QP, STAGES, PLANT = (same_optimum,), (stages_agree,), (books_balance,)
BATTERY = next(row for row in rows.ROWS if row.name == "battery")
RENDERINGS, BACKENDS = (one_qp,), (common_problems,)
NLP = (plans_beside_the_nonlinear_program,)

MUTATIONS = [
    # plant
    Mutation(
        "discharge raises SOC (eq. 1)", Plant, "step",
        "state.soc - h * current", "state.soc + h * current", PLANT,
    ),
    Mutation(
        "plant forgets auxiliary power (eq. 2)", Plant, "step",
        "demand_w + battery.aux_power_w + cranking", "demand_w + cranking", PLANT,
    ),
    Mutation(
        "plant's UA in km/h", qpmpc.vehicle.heat, "ua_w_per_k",
        "* speed_mps", "* 3.6 * speed_mps", PLANT,
    ),
    Mutation(
        "plant burns at alpha of the hot engine", Plant, "step",
        "alpha_at(vehicle.cold_engine, state.t_cl_degc)", "1.0", PLANT,
    ),
    Mutation(
        "heating value in kJ", OptimalLine, "_from_map",
        "engine.lhv_j_per_kg * 1e3", "engine.lhv_j_per_kg", (engine_covers_demand, *NLP),
        ("No battery use", "First command, power", "Predicted T_cl", "Planned fuel"),
    ),
    Mutation(
        "demand times driveline efficiency", qpmpc.preview.forecast, "demand_w",
        "wheel_w / chassis.eta_drive", "wheel_w * chassis.eta_drive", (*STAGES, *PLANT),
    ),
    # curves
    Mutation(
        "a PWA piece is shifted", qpmpc.pwa.model, "fit_convex",
        "        intercept,\n        unchecked",
        "        intercept + 0.01 * (np.arange(len(slope)) == 1),\n        unchecked",
        (bounds_hold,),
    ),
    Mutation(
        "battery curve fitted to terminal power", qpmpc.pwa.model, "_battery_samples",
        "BatteryMaps(battery).internal_power_w(soc, power)", "power", (bounds_hold,),
    ),
    # preview
    Mutation(
        "preview forgets auxiliary power", Trace, "battery_side_w",
        "self.demand_w + battery.aux_power_w", "self.demand_w", STAGES,
    ),
    Mutation(
        "long stages are too short", StageBuilder, "_long_fields",
        "    return fields", "    fields[0] *= 0.9\n    return fields", STAGES,
    ),
    Mutation(
        "long horizon is a second late", StageBuilder, "_edges",
        "else self.beyond(step)", "else self.beyond(step + 1)", STAGES,
    ),
    Mutation(
        "battery loss of the mean, not mean loss", qpmpc.preview.stages, "_fields",
        "trace.internal_off_w(vehicle)", "trace.battery_side_w(vehicle)", STAGES,
    ),
    # QP
    Mutation(
        "state of two stages before", QpStructure, "__init__",
        "(k - self.entry_before) * self.variables",
        "(k - 2 * self.entry_before) * self.variables", QP,
    ),
    Mutation(
        "alpha' = 0", rows, "QUANTITIES",
        "pwa_alpha_slope(about_t_cl_degc) *", "0.0 *", QP,
    ),
    Mutation(
        "wrong terminal band", qpmpc.qp.stage_qp, "qp_parameters",
        "max(settings.terminal_low", "max(0.98 * settings.terminal_low", (*QP, *NLP),
        ("Optimum of the QP", "SOC at arrival"),
    ),
    Mutation(
        "UA of a stage in km/h", rows, "QUANTITIES",
        "ua_w_per_k(speed_mps)", "ua_w_per_k(3.6 * speed_mps)", QP,
    ),
    Mutation(
        "QP's heating value in kJ", rows, "QUANTITIES",
        "per_power * lhv_j_per_g", "per_power * 0.001 * lhv_j_per_g", QP,
    ),
    Mutation(
        "fuel rows are dropped", StageQp, "_fill_constants",
        "elif bound is not None", "elif bound is not None and row.pieces != 'fuel'", QP,
    ),
    Mutation(
        "off-part of the perspective is dropped", BATTERY, "text",
        ">= free_internal_off_w", ">= 0.0",
        (*QP, *NLP, constant_demand),
        ("Optimum of the QP", "First command, on or off", "Predicted T_cl", "Constant demand"),
    ),
    Mutation(
        "cost of the stage after", StageQp, "update",
        "(self.stages, 1))[1:]", "(self.stages, 1))[:-1]", QP,
    ),
    Mutation(
        "no cabin heat", rows, "QUANTITIES",
        " - cabin_w(about_t_cl_degc)", "", (*QP, *NLP),
        ("Optimum of the QP", "Predicted T_cl"),
    ),
    Mutation(
        "radiator of a stage as open as at its end", physics_checks, "thermostat_step",
        "opened = aim * settled", "opened = straight / (1.0 + duration_s / tau)",
        (thermostat_exact,),
    ),
    # scaling and warm start
    Mutation(
        "state before in the units of this stage", StageQp, "_scaled",
        "before[1:] = column[:-1]", "before[1:] = 2.0 * column[:-1]", (*QP, scaling_is_neutral),
    ),
    Mutation(
        "duals keep the cost's scale", Scaling, "dual",
        "y * self.row / self.cost", "y * self.row", (*QP, warm_start_shifted),
    ),
    Mutation(
        "warm start is not shifted", StageBuilder, "shift",
        "+= 1", "+= 0", (warm_start_shifted,),
    ),
    # other renderings
    Mutation(
        "cvxpy with all pieces as the first", CvxpyTwin, "_of_piece",
        "column = piece if", "column = 0 if", RENDERINGS,
        ("Matrices, cvxpy", "Optimum, cvxpy"),
    ),
    Mutation(
        "generated C with another terminal band", qpmpc.codegen.values, "_solver",
        "admm.relaxation,", "admm.relaxation, 'terminal_soc_low': 0.59,", RENDERINGS,
        ("Matrices, c", "Optimum, c"),
    ),
    # the nonlinear program
    Mutation(
        "IPOPT is taken to fail where it needs many iterations", NlpSolver, "_plan",
        'bool(stats["success"])', 'int(stats["iter_count"]) < 12', NLP,
        ("States without a plan",),
    ),
    # backends
    Mutation(
        "one-sided rows with a side forgotten", OneSided, "right_sides",
        "-data.lower[self._below]", "-0.9 * data.lower[self._below]", BACKENDS,
        ("Backend clarabel", "Backend qoco", "KKT residuals, clarabel"),
    ),
    Mutation(
        "duals of lower sides with the wrong sign", OneSided, "join",
        "y[self._below] -= inequality", "y[self._below] += inequality", BACKENDS,
        ("KKT residuals, clarabel", "KKT residuals, qoco"),
    ),
    Mutation(
        "a backend calls the infeasible solved", Qoco, "_run",
        "status = Status.INFEASIBLE", "status = Status.SOLVED", BACKENDS,
        ("Infeasible QPs, qoco",),
    ),
    # closed loop
    Mutation(
        "solver keeps old bounds", Osqp, "solve",
        "l=data.lower, u=data.upper, ", "", (limits_kept, relaxation_tight, warm_start_shifted),
    ),
    Mutation(
        "engine on whatever the share", RecedingHorizon, "_realised",
        "if not engine_runs(ahead, arrival_s, seen, vehicle, least_w, fast_s, stay_share):",
        "if False:",
        (limits_kept, bound_below_everything, relaxation_tight),
        also=Replacement(
            qpmpc.controllers.qp_planner, "power_while_on_w",
            "runs = on_share >= STAY_SHARE", "runs = on_share >= 0.0",
        ),
    ),
]  # fmt: skip


@pytest.fixture(autouse=True)
def fewer(monkeypatch):
    """A part of what the quick run tries is enough here, and takes a fifth of the time."""
    monkeypatch.setattr(rendering_checks, "QUICK_EVERY", 250)
    monkeypatch.setattr(rendering_checks, "QUICK_RANDOM", 3)
    monkeypatch.setattr(backend_checks, "QUICK_BACKENDS", ("clarabel", "daqp", "qoco"))
    monkeypatch.setattr(nlp_checks, "EVERY", 120)


def failures(*checks: Callable[..., Any]) -> list[str]:
    context = Context(quick=True, vehicle=load_vehicle(CAR))
    found = list(run_checks(Group("", checks), context))
    crashed = [check.detail for check in found if "could not be completed" in check.name]
    assert not crashed, "a check must notice, not break down"
    return [check.name for check in found if not check.passed]


def mutate(monkeypatch: pytest.MonkeyPatch, mutation: Mutation | Replacement) -> None:
    member = inspect.getattr_static(mutation.owner, mutation.name)
    if isinstance(member, str):  # of the table
        assert member.count(mutation.old) == 1
        changed = {mutation.name: member.replace(mutation.old, mutation.new)}
        if isinstance(mutation.owner, rows.Row):  # with what it has parsed
            row = replace(mutation.owner, **changed)
            changed |= {"terms": row.terms, "_compared": row._compared}
        for name, value in changed.items():
            monkeypatch.setitem(vars(mutation.owner), name, value)
        return
    function = getattr(member, "__func__", member)
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(mutation.old) == 1, f"{mutation.old!r} is not there, or more than once"
    # a function imported by name looks its own module's names up, not the importer's
    names = dict(function.__globals__)
    exec(source.replace(mutation.old, mutation.new), names)
    monkeypatch.setattr(mutation.owner, mutation.name, names[mutation.name])


@pytest.fixture(autouse=True)
def nothing_kept():
    """Curves are kept by their parameters: those of a mutation must not meet those of another."""
    kept = (qpmpc.pwa.model._fuel, qpmpc.pwa.model._battery, qpmpc.pwa.model._alpha, optimal_line)
    for function in kept:
        function.cache_clear()
    yield
    for function in kept:
        function.cache_clear()


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.title)
def test_mutation_is_caught(monkeypatch, mutation):
    if mutation.owner is qpmpc.codegen.values and compiler() is None:
        pytest.skip("no C compiler on this machine")
    groups = [CHECKS.find(name) for name in CHECKS.names()]
    quick = [check for group in groups if group.quick for check in group.checks]
    assert set(mutation.checks) <= set(quick)
    mutate(monkeypatch, mutation)
    if mutation.also is not None:
        mutate(monkeypatch, mutation.also)
    monkeypatch.setattr(generated_qp, "SLICES", 10)  # what is wrong may never converge
    found = failures(*mutation.checks)
    assert found
    for name in mutation.noticed:
        assert any(failed.startswith(name) for failed in found), found


def test_the_product_as_it_is_passes_the_same_checks():
    checks = {check: None for mutation in MUTATIONS for check in mutation.checks}
    assert failures(*checks, trip_error_small, expansion_small) == []


@pytest.mark.parametrize(
    ("changes", "failing"),
    [
        # each check passes where the other fails
        ({"mh_qp.admm.iterations": 2}, {"Fuel beside mh-nlp"}),
        ({"mh_qp.admm.iterations": 3000}, {"Time beside mh-nlp"}),
    ],
)
def test_closed_loops_beside_the_nonlinear_program(monkeypatch, changes, failing):
    """The full run's checks fail too: where `mh-qp` hardly solves its QPs, or takes its time."""
    whole, part = load_cycle("nycc"), slice(250, 331)
    short = Cycle("short", np.arange(81.0), whole.speed_mps[part], whole.grade[part])
    monkeypatch.setattr(nlp_checks, "cycle_names", lambda: ("short",))
    monkeypatch.setattr(Context, "trip", lambda self, _: Trip(short, self.vehicle))
    context = Context(quick=False, vehicle=load_vehicle(CAR))
    context.settings = ControllerSettings().with_settings(changes)
    found = list(run_checks(Group("", (against_the_nonlinear_program,)), context))
    assert len(found) == 2
    assert {check.name.partition(",")[0] for check in found if not check.passed} == failing
