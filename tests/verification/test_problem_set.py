"""The common problem set: what it is made of, and that every backend copes with all of it."""

import numpy as np
import pytest

from qpmpc.solvers import QpSolver, Status, make_solver, solver_names
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.osqp import Osqp
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.checks.backend_checks import AGREE, CYCLING, DENSE, LOOSE, TO_THE_END
from qpmpc.verification.problems.problem_set import Problem, problem_set
from qpmpc.verification.renderings.kkt import objective

ACTIVE = 1e-6  # solver units


@pytest.fixture(scope="module")
def problems() -> list[Problem]:
    return problem_set(load_vehicle())


def of_kind(problems: list[Problem], kind: str) -> list[Problem]:
    return [p for p in problems if p.kind == kind]


def solved(name: str, problem: Problem, tolerance: float = 1e-8):
    solver: QpSolver = Osqp(TO_THE_END) if name == "osqp" else make_solver(name, tolerance)
    solver.setup(problem.structure, problem.data)
    return solver.solve(problem.data, None, None, cold=True)


def test_all_kinds_are_there_under_names_of_their_own(problems) -> None:
    assert len({p.name for p in problems}) == len(problems)
    assert len(of_kind(problems, "ordinary")) >= 8
    assert len(of_kind(problems, "degenerate")) >= 8
    assert len(of_kind(problems, "infeasible")) >= 8


def test_exactly_the_infeasible_ones_have_no_feasible_point(problems) -> None:
    for problem in problems:
        found = is_infeasible(problem.structure, problem.data)
        assert found == (problem.kind == "infeasible"), problem.name


def test_degenerate_ones_are(problems) -> None:
    """Active rows that depend on each other, or variables that cost nothing at all."""
    for problem in of_kind(problems, "degenerate"):
        structure, data = problem.structure, problem.data
        best = solved("piqp", problem, 1e-9)
        assert best.status is Status.SOLVED, problem.name
        a = structure.matrix_of(data.a_data).toarray()
        row = a @ best.primal
        active = (np.abs(row - data.lower) < ACTIVE) | (np.abs(row - data.upper) < ACTIVE)
        values = np.linalg.svd(a[active], compute_uv=False)
        dependent = int(active.sum() - (values > 1e-9 * values[0]).sum())
        masked = int((data.q == 0.0).sum()) > data.q.size // 2
        assert dependent > 0 or masked, problem.name
        if "without curvature" in problem.name:
            assert not data.hessian.any()


@pytest.mark.slow
@pytest.mark.parametrize("name", solver_names())
def test_backend(name: str, problems) -> None:
    # they take a second for each: the harder ones of the city are enough for them here
    slow = name in ("osqp", "proxqp", "scs")
    if name in DENSE:
        pytest.skip("a quarter of a minute for each; see tests/solvers/test_backends.py")
    hard = [p for p in problems if p.name.startswith("city") and p.kind != "ordinary"]
    chosen = hard if slow else problems
    loose = LOOSE.get(name, AGREE)
    for problem in chosen:
        found = solved(name, problem)
        if problem.kind == "infeasible":
            assert found.status is Status.INFEASIBLE, problem.name
            continue
        if name in CYCLING and not found.usable:
            continue
        assert found.usable, problem.name
        best = objective(problem.data, solved("piqp", problem, 1e-9).primal)
        assert objective(problem.data, found.primal) == pytest.approx(
            best, abs=loose * (1.0 + abs(best))
        ), problem.name
