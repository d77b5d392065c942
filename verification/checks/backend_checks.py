"""Every installed backend on the same QPs: the same cost, and no solution to infeasible QPs."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import QpSolution, QpSolver, Status
from qpmpc.solvers.names import make_solver, solver_names
from qpmpc.solvers.osqp import Osqp
from qpmpc.solvers.settings import AdmmSettings
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.qp_checks import exact, samples
from qpmpc.verification.problems.problem_set import Problem, problem_set
from qpmpc.verification.renderings.kkt import kkt_residuals, objective

QUICK_BACKENDS = (
    "osqp",
    "piqp",
    "clarabel",
    "hpipm",
    "daqp",
    "qoco",
)  # the others take seconds per QP
QUICK_TRIP = "city"  # of the problem set
TOLERANCE = 1e-8  # set in the solvers, in their own measures
AGREE = 1e-6  # relative cost
# first-order, or stopping at larger residuals
LOOSE = {"osqp": 1e-4, "scs": 1e-5, "highs": 1e-5, "proxqp": 1e-5, "hpipm": 1e-5}
RESIDUAL, LOOSE_RESIDUAL = 1e-5, {"osqp": 1e-3, "scs": 1e-2}  # of the largest dual
DENSE = ("qpoases",)  # 10 s per QP from cold: the tests have it on shorter horizons
CYCLING = ("highs",)  # see `qpmpc.solvers.highs`
# In a car it makes 50 iterations from a warm start and need not detect convergence
TO_THE_END = AdmmSettings(cold_iterations=100_000, status_tolerance=1e-7)


class Solvable(NamedTuple):
    """A QP with its solution by the reference backend."""

    structure: QpStructure
    data: QpData
    best: QpSolution


def recorded_qps(context: Context) -> Iterator[Check]:
    """Backends on QPs recorded along the closed loops: KKT residuals, and the same cost."""
    for loop in context.loops:
        structure = loop.controller.planner.qp.structure
        found = [loop.solves[k].data for k in samples(context, loop)[:: 3 if context.quick else 4]]
        qps = [Solvable(structure, data, exact(structure, data)) for data in found]
        for name in _backends(context):
            yield from _agreement(name, loop.name, qps, "recorded")


def common_problems(context: Context) -> Iterator[Check]:
    """Backends on the problem set: the same cost if there is a solution, else none reported."""
    problems = [
        p
        for p in problem_set(context.vehicle, context.settings)
        if not context.quick or p.name.startswith(QUICK_TRIP)
    ]
    qps = [
        Solvable(p.structure, p.data, exact(p.structure, p.data))
        for p in problems
        if p.kind != "infeasible"
    ]
    degenerate = sum(p.kind == "degenerate" for p in problems)
    kinds = f"{len(qps) - degenerate} ordinary, {degenerate} degenerate"
    impossible = [p for p in problems if p.kind == "infeasible"]
    for name in _backends(context):
        yield from _agreement(name, "problem set", qps, kinds)
        yield _infeasible(name, impossible)


def _backends(context: Context) -> tuple[str, ...]:
    return QUICK_BACKENDS if context.quick else tuple(n for n in solver_names() if n not in DENSE)


def _solve(name: str, structure: QpStructure, data: QpData) -> QpSolution:
    solver: QpSolver = Osqp(TO_THE_END) if name == "osqp" else make_solver(name, TOLERANCE)
    solver.setup(structure, data)
    return solver.solve(data, None, None, cold=True)


def _agreement(name: str, what: str, qps: Sequence[Solvable], kinds: str) -> Iterator[Check]:
    residual, off, unsolved = 0.0, 0.0, []
    for structure, data, best in qps:
        solution = _solve(name, structure, data)
        if not solution.usable:
            unsolved.append(solution.status.value)
            continue
        found = kkt_residuals(structure, data, solution.primal, solution.dual)
        residual = max(residual, found.largest / (1.0 + float(np.abs(solution.dual).max())))
        cost = objective(data, best.primal)
        off = max(off, abs(objective(data, solution.primal) - cost) / (1.0 + abs(cost)))
    detail = f"{len(qps) - len(unsolved)} of {len(qps)} solved ({kinds})"
    if unsolved:
        detail += f"; others: {', '.join(sorted(set(unsolved)))}"
    if not all(best.usable for _, _, best in qps):
        detail += "; the reference backend has not solved all"
        off = float("nan")
    if len(unsolved) == len(qps) or (unsolved and name not in CYCLING):
        off = residual = float("nan")
    which = "The QPs that it solves cost" if name in CYCLING else "Every QP is solved, and costs"
    yield Check(
        f"Backend {name}, {what}",
        f"{which} the same as by the reference backend.",
        LOOSE.get(name, AGREE),
        off,
        "relative",
        detail,
    )
    yield Check(
        f"KKT residuals, {name}, {what}",
        "Its solutions keep the rows, and its duals prove them optimal.",
        LOOSE_RESIDUAL.get(name, RESIDUAL),
        residual,
        "of the largest dual",
        "recomputed from the data, in solver units",
    )


def _infeasible(name: str, problems: Sequence[Problem]) -> Check:
    found, claimed = 0, []
    for problem in problems:
        status = _solve(name, problem.structure, problem.data).status
        found += status is Status.INFEASIBLE
        if status is Status.SOLVED:
            claimed.append(problem.name)
    detail = f"{found} of {len(problems)} found infeasible"
    if claimed:
        detail += f"; claimed: {', '.join(claimed)}"
    return Check(
        f"Infeasible QPs, {name}",
        "No QP without a solution is reported as solved.",
        0.0,
        float(len(claimed)),
        "QPs",
        detail,
    )
