"""Every check can fail: break an ingredient, and the quick checks notice.

A mutation replaces a piece of source text, which must occur exactly once, in a function of the
product. The test then runs the quick checks that should notice on a fresh context; the mutation
is caught if one of them fails.
"""

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

import qpmpc.preview.forecast
import qpmpc.preview.stages
import qpmpc.pwa.model
import qpmpc.qp.stage_qp
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.preview.forecast import Trace
from qpmpc.preview.stages import StageBuilder
from qpmpc.qp.scaling import Scaling
from qpmpc.qp.stage_qp import StageQp
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.osqp import Osqp
from qpmpc.vehicle import Plant
from qpmpc.vehicle.engine import OptimalLine
from qpmpc.verification.verify import GROUPS, Context, Group, physics_checks, run_checks
from qpmpc.verification.verify.balance_checks import books_balance, limits_kept
from qpmpc.verification.verify.bound_checks import bound_below_everything
from qpmpc.verification.verify.physics_checks import (
    constant_demand,
    engine_covers_demand,
    thermostat_exact,
)
from qpmpc.verification.verify.pwa_checks import bounds_hold, trip_error_small
from qpmpc.verification.verify.qp_checks import (
    same_optimum,
    scaling_is_neutral,
    stages_agree,
    warm_start_shifted,
)
from qpmpc.verification.verify.relaxation_checks import expansion_small, relaxation_tight

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Mutation:
    """`old` becomes `new` in the function `name` of `owner`; `checks` should notice."""

    title: str
    owner: Any
    name: str
    old: str
    new: str
    checks: tuple[Callable[..., Any], ...]


QP, STAGES, PLANT = (same_optimum,), (stages_agree,), (books_balance,)

MUTATIONS = [
    # plant
    Mutation(
        "discharge raises SOC (eq. 1)", Plant, "step",
        "state.soc - h * current", "state.soc + h * current", PLANT,
    ),
    Mutation(
        "plant forgets auxiliary power (eq. 2)", Plant, "step",
        "demand_w + battery.aux_power_w - p_eng", "demand_w - p_eng", PLANT,
    ),
    Mutation(
        "plant's UA in km/h", Plant, "air_w",
        "* speed_mps", "* 3.6 * speed_mps", PLANT,
    ),
    Mutation(
        "plant burns at alpha of the hot engine", Plant, "step",
        "alpha_at(vehicle.cold_engine, state.t_cl_degc)", "1.0", PLANT,
    ),
    Mutation(
        "heating value in kJ", OptimalLine, "__init__",
        "engine.lhv_j_per_kg * 1e3", "engine.lhv_j_per_kg", (engine_covers_demand,),
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
        "battery curve fitted to terminal power", qpmpc.pwa.model, "battery_samples",
        "maps.internal_power_w(vehicle.trip.soc_init, power)", "power", (bounds_hold,),
    ),
    # preview
    Mutation(
        "preview forgets auxiliary power", Trace, "battery_side_w",
        "self.demand_w + battery.aux_power_w", "self.demand_w", STAGES,
    ),
    Mutation(
        "long stages are too short", StageBuilder, "at",
        "fields[0, n_short:] = duration", "fields[0, n_short:] = 0.9 * duration", STAGES,
    ),
    Mutation(
        "long horizon is a second late", StageBuilder, "at",
        "np.clip(step + seen, self", "np.clip(step + seen + 1, self", STAGES,
    ),
    Mutation(
        "battery loss of the mean, not mean loss", qpmpc.preview.stages, "_fields",
        "trace.internal_off_w(vehicle)", "trace.battery_side_w(vehicle)", STAGES,
    ),
    # QP
    Mutation(
        "state of two stages before", QpStructure, "__init__",
        "(k - self.entry_before) * VARS", "(k - 2 * self.entry_before) * VARS", QP,
    ),
    Mutation(
        "alpha' = 0", qpmpc.qp.stage_qp, "coolant_row",
        "* about.fuel_g_per_s\n    ua", "* 0.0\n    ua", QP,
    ),
    Mutation(
        "wrong terminal band", StageQp, "_terminal",
        "return multiple", "return 0.98 * multiple", QP,
    ),
    Mutation(
        "UA of a stage in km/h", qpmpc.qp.stage_qp, "coolant_row",
        "* stages.speed_mps", "* 3.6 * stages.speed_mps", QP,
    ),
    Mutation(
        "QP's heating value in kJ", StageQp, "_fill_coolant",
        "engine.lhv_j_per_g", "engine.lhv_j_per_g * 1e-3", QP,
    ),
    Mutation(
        "a fuel row is dropped", StageQp, "_constant_bounds",
        "lower[:, rows.fuel] = 0.0", "lower[:, rows.fuel.start + 1 : rows.fuel.stop] = 0.0", QP,
    ),
    Mutation(
        "off-part of the perspective is dropped", StageQp, "_fill_battery",
        "self._lower[:, rows.battery] = off_w[:, None]", "self._lower[:, rows.battery] = 0.0",
        (*QP, constant_demand),
    ),
    Mutation(
        "cost of the stage after", StageQp, "update",
        "t_cl_weight[1:]", "t_cl_weight[:-1]", QP,
    ),
    Mutation(
        "no cabin heat", qpmpc.qp.stage_qp, "coolant_row",
        "heat_at_zero -= _cabin_w(th, about.t_cl_degc)", "", QP,
    ),
    Mutation(
        "radiator of a stage as open as at its end", physics_checks, "coolant_step",
        "end = np.select(cases, [after_line,",
        "end = np.select(cases, [straight / (1.0 + duration_s / tau),", (thermostat_exact,),
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
    # closed loop
    Mutation(
        "solver keeps old bounds", Osqp, "solve",
        "l=data.lower, u=data.upper, ", "", (limits_kept, relaxation_tight, warm_start_shifted),
    ),
    Mutation(
        "engine on whatever the share", MhQp, "_realise",
        "if sigma < ON_THRESHOLD", "if sigma < 0.0",
        (limits_kept, bound_below_everything, relaxation_tight),
    ),
]  # fmt: skip


def failures(*checks: Callable[..., Any]) -> list[str]:
    context = Context(quick=True)
    found = list(run_checks(Group("", checks), context))
    crashed = [check.detail for check in found if "could not be completed" in check.name]
    assert not crashed, "a check must notice, not break down"
    return [check.name for check in found if not check.passed]


def mutate(monkeypatch: pytest.MonkeyPatch, mutation: Mutation) -> None:
    member = inspect.getattr_static(mutation.owner, mutation.name)
    function = getattr(member, "__func__", member)
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(mutation.old) == 1, f"{mutation.old!r} is not there, or more than once"
    # a function imported by name looks its own module's names up, not the importer's
    names = dict(function.__globals__)
    exec(source.replace(mutation.old, mutation.new), names)
    monkeypatch.setattr(mutation.owner, mutation.name, names[mutation.name])


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.title)
def test_mutation_is_caught(monkeypatch, mutation):
    quick = [check for group in GROUPS if group.quick for check in group.checks]
    assert set(mutation.checks) <= set(quick)
    mutate(monkeypatch, mutation)
    assert failures(*mutation.checks)


def test_the_product_as_it_is_passes_the_same_checks():
    checks = {check: None for mutation in MUTATIONS for check in mutation.checks}
    assert failures(*checks, trip_error_small, expansion_small) == []
