"""What others get: npz files, and a test set that qpbenchmark can run."""

import abc
import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers import make_solver
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.benchmark.export import write_qps
from qpmpc.verification.problems.problem_set import Problem, problem_set
from qpmpc.verification.problems.recorder import Recording, record
from qpmpc.verification.renderings.kkt import objective

VEHICLE = load_vehicle()
STEPS = 45


class NamedProblem(qpsolvers.Problem):
    """Like qpbenchmark's: a problem of qpsolvers with a name."""

    def __init__(self, P, q, G, h, A, b, lb, ub, name):
        super().__init__(P, q, G, h, A, b, lb, ub)
        self.name = name


class AbstractTestSet(abc.ABC):
    """What qpbenchmark 2 asks of a test set."""

    @abc.abstractmethod
    def __iter__(self): ...

    @property
    @abc.abstractmethod
    def description(self): ...

    @property
    @abc.abstractmethod
    def sparse_only(self): ...

    @property
    @abc.abstractmethod
    def title(self): ...


@pytest.fixture(scope="module")
def recording() -> Recording:
    nycc = load_cycle("nycc")
    inside = slice(60, 60 + STEPS + 1)
    trip = Cycle("short", np.arange(STEPS + 1.0), nycc.speed_mps[inside], np.zeros(STEPS + 1))
    return record(Trip(trip, VEHICLE))


@pytest.fixture(scope="module")
def problems() -> list[Problem]:
    return problem_set(VEHICLE)


@pytest.fixture(scope="module")
def folder(recording, problems, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("qps")
    write_qps([recording], problems, folder)
    return folder


@pytest.fixture
def test_set(folder, monkeypatch):
    """The class that qpbenchmark would look for, by the name of the file, and load on its own."""
    stand_in = ModuleType("qpbenchmark")
    stand_in.TestSet, stand_in.Problem = AbstractTestSet, NamedProblem
    monkeypatch.setitem(sys.modules, "qpbenchmark", stand_in)
    file = folder / "qpmpc_recorded.py"
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, file.stem.title().replace("_", ""))()


def test_files(folder) -> None:
    assert {file.name for file in folder.iterdir()} == {
        "qps_short.npz", "qps_problem_set.npz", "qpmpc_recorded.py",
    }  # fmt: skip


def test_problem_set_file_has_every_problem(folder, problems) -> None:
    with np.load(folder / "qps_problem_set.npz") as data:
        assert data["names"].tolist() == [p.name for p in problems]
        assert set(data["kinds"].tolist()) == {"ordinary", "degenerate", "infeasible"}
        for k, problem in enumerate(problems):
            assert bool(data["solvable"][k]) == (problem.kind != "infeasible")
            pattern = data["a_indices"], data["a_indptr"]
            a = sp.csc_matrix((data["a_data"][k], *pattern), shape=problem.structure.shape)
            ours = problem.structure.matrix_of(problem.data.a_data)
            assert abs(a - ours).max() == 0.0
            for part in ("hessian", "q", "lower", "upper"):
                np.testing.assert_array_equal(data[part][k], getattr(problem.data, part))


def test_set_holds_what_can_be_solved(test_set, problems) -> None:
    found = list(test_set)
    names = [problem.name for problem in found]
    assert len(set(names)) == len(names)
    assert sum(name.startswith("short: step") for name in names) == 3  # each twentieth of 45
    assert sum(name.startswith("problem_set") for name in names) == sum(
        p.kind != "infeasible" for p in problems
    )
    assert test_set.sparse_only
    assert all(sp.issparse(part) for problem in found for part in (problem.P, problem.G, problem.A))
    assert test_set.title
    assert test_set.description.endswith(".")


def test_optima_are_those_of_the_controller(test_set, recording, problems) -> None:
    """Solved from the exported form, by another solver, they cost what ours cost."""
    steps = [qp.data for qp in recording.on_the_road]
    ours = {f"short: step {k}": (recording.structure, steps[k]) for k in range(0, STEPS, 20)}
    ours |= {f"problem_set: {p.name}": (p.structure, p.data) for p in problems}
    for problem in test_set:
        structure, data = ours[problem.name]
        solver = make_solver("piqp", 1e-9)
        solver.setup(structure, data)
        best = objective(data, solver.solve(data, None, None).primal)
        found = qpsolvers.solve_problem(problem, "clarabel")
        assert found.found, problem.name
        assert found.obj == pytest.approx(best, abs=1e-5 * (1.0 + abs(best))), problem.name


def test_problems_of_different_sizes_are_refused(problems, tmp_path) -> None:
    smaller = QpStructure(3, problems[0].structure.rows)
    other = replace(problems[0], structure=smaller)
    with pytest.raises(ValueError, match="sizes"):
        write_qps([], [problems[0], other], tmp_path)
