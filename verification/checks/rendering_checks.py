"""The other renderings of QP and controller, with the inputs of the closed loops."""

from collections.abc import Iterator
from math import nan

import numpy as np

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.vehicle import PlantState
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context, Loop

QUICK_EVERY, QUICK_RANDOM = 30, 16  # recorded steps from one case to the next; random cases
FULL_EVERY, FULL_RANDOM = 8, 100
SEED = 1
ENTRIES = 1e-12  # of rows of unit norm, in solver units: some hundred roundings
OPTIMUM = 1e-6
NAMES = {
    "cvxpy": "The QP compiled by cvxpy",
    "c": "The QP in the generated C, read through its own solver,",
}
F64_W = 1e-3  # after hundreds of steps, each warm-started from the last
NO_COMPILER = "no C compiler here"
CLAIM = "Fed with the same measurements, generated C commands the same power as Python."


def one_qp(context: Context) -> Iterator[Check]:
    """The QP in all its renderings, on recorded and random states."""
    from qpmpc.verification.renderings.equivalence import check_equivalence

    every, random = (QUICK_EVERY, QUICK_RANDOM) if context.quick else (FULL_EVERY, FULL_RANDOM)
    for name in context.cycles:
        found = check_equivalence(context.trip(name), every, random, SEED, context.settings)
        worst = found.worst()
        cases = f"{len(found.cases) - random} recorded and {random} random cases"
        for key, what in NAMES.items():
            titles = (f"Matrices, {key}, {name}", f"Optimum, {key}, {name}")
            claims = (
                f"{what} has the same rows, bounds and cost as numpy's, in any order.",
                f"{what} has the same optimum as numpy's, and its solution keeps numpy's rows.",
            )
            if key not in worst:
                for title, claim in zip(titles, claims, strict=True):
                    yield Check(title, claim, 0.0, nan, "", NO_COMPILER, skipped=True)
                continue
            of = worst[key]
            yield Check(titles[0], claims[0], ENTRIES, of.matrices, "", cases)
            detail = f"{cases}; cost off by {of.optimum:.1e}, rows by {of.violation:.1e}"
            worse = float(np.max([of.optimum, of.violation]))  # nan if one of them is
            yield Check(titles[1], claims[1], OPTIMUM, worse, "", detail)


def generated_c(context: Context) -> Iterator[Check]:
    """The generated C of this machine, in double precision, along the closed loops."""
    for loop in context.loops:
        title = f"Generated C, {loop.name}"
        if compiler() is None:
            yield Check(title, CLAIM, F64_W, nan, "W", NO_COMPILER, skipped=True)
            continue
        worst, flips = _compare(loop, context)
        yield Check(
            title, CLAIM, F64_W, worst, "W", f"engine state differs in {flips} of "
            f"{loop.trip.steps} steps"
        )  # fmt: skip


def _compare(loop: Loop, context: Context) -> tuple[float, int]:
    """Largest difference of the engine power applied, W, and steps with another engine state."""
    tr = loop.run.trajectory
    controller = GeneratedController(loop.trip, context.settings)
    worst, flips, was_on = 0.0, 0, False
    for k in range(loop.trip.steps):
        state = PlantState(float(tr.soc[k]), float(tr.t_cl_degc[k]), was_on)
        command = controller.decide(loop.trip.observation(k, state)).command
        flips += command.engine_on != bool(tr.engine_on[k])
        worst = max(worst, abs(command.p_eng_w - float(tr.p_eng_w[k])))
        was_on = bool(tr.engine_on[k])
    return worst, flips
