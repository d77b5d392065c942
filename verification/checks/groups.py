"""The groups of checks; their names and their order are in `qpmpc.registry`."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from qpmpc.verification.checks import (
    backend_checks,
    balance_checks,
    bound_checks,
    epa_checks,
    nlp_checks,
    physics_checks,
    pwa_checks,
    qp_checks,
    relaxation_checks,
    relaxed_trip_checks,
    rendering_checks,
    safety_checks,
    start_checks,
)
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context

Checks = Callable[[Context], Iterable[Check]]


@dataclass(frozen=True)
class Group:
    """Checks under one heading.

    Attributes
    ----------
    title : heading
    checks : functions, each of which yields checks
    quick : whether they are part of the quick run, on fewer cycles and samples
    """

    title: str
    checks: tuple[Checks, ...]
    quick: bool = True


PWA = Group("Piecewise-affine curves", (pwa_checks.bounds_hold, pwa_checks.trip_error_small))
RELAXATION = Group(
    "Relaxation and expansion",
    (relaxation_checks.relaxation_tight, relaxation_checks.expansion_small),
)
QP = Group(
    "The QP against the equations",
    (
        qp_checks.stages_agree,
        qp_checks.same_optimum,
        qp_checks.warm_start_shifted,
        qp_checks.scaling_is_neutral,
    ),
)
BACKENDS = Group("QP backends", (backend_checks.recorded_qps, backend_checks.common_problems))
RENDERINGS = Group("Other renderings", (rendering_checks.one_qp, rendering_checks.generated_c))
NLP = Group("The nonlinear program", (nlp_checks.plans_beside_the_nonlinear_program,))
NLP_LOOP = Group(
    "The nonlinear program in closed loop",
    (nlp_checks.against_the_nonlinear_program,),
    quick=False,
)
BALANCES = Group("Balances and limits", (balance_checks.books_balance, balance_checks.limits_kept))
PHYSICS = Group(
    "Physics",
    (
        physics_checks.constant_demand,
        physics_checks.thermostat_exact,
        physics_checks.engine_covers_demand,
        physics_checks.uncoupled,
        physics_checks.monotone,
        physics_checks.dimensions,
    ),
)
SAFETY = Group("Safety of the next second", (safety_checks.no_command_is_safer,))
EPA = Group("EPA's dynamometer", (epa_checks.epa_figures,))
BOUNDS = Group(
    "Least fuel of a trip",
    (bound_checks.bound_below_everything, relaxed_trip_checks.relaxed_trip_close),
)
STARTS = Group("Starts that cost something", (start_checks.with_starts,), quick=False)


def run_checks(group: Group, context: Context) -> Iterator[Check]:
    """Run a group's checks one after the other.

    A function that raises counts as a failed check, so that the others still run.
    """
    for function in group.checks:
        try:
            yield from function(context)
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            name = f"{function.__name__} could not be completed"
            yield Check(name, "The check runs to its end.", 0.0, float("nan"), "", reason)
