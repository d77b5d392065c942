"""The optimal-control form is the same QP: points keep cost and rows, whatever its values."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.solvers import Status, make_solver
from qpmpc.solvers.forms import BoundsApart
from qpmpc.solvers.ocp_form import OcpForm
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.problems.recorder import Recording, record
from qpmpc.verification.renderings.kkt import objective

ROUNDING = 1e-12


@pytest.fixture(scope="module", params=["prius-nimh", "paper-nimh"])
def recording(request: pytest.FixtureRequest) -> Recording:
    """With starts that cost something, which need a copy of a control, and without."""
    nycc = load_cycle("nycc")
    cycle = Cycle("short", np.arange(31.0), nycc.speed_mps[60:91], np.zeros(31))
    return record(Trip(cycle, load_vehicle(request.param)))


def test_blocks_are_where_the_nodes_are(recording: Recording) -> None:
    """Rows of node k see its own variables only, dynamics the states of the next with -1 or so."""
    structure = recording.structure
    form = OcpForm(structure)
    data = recording.solves[10].data
    a = sp.csc_matrix((form.values(data), form.indices, form.indptr), shape=form.shape).tocsr()
    row = column = 0
    for k in range(structure.stages + 1):
        own = range(column, column + form.nx[k] + form.nu[k])
        given_by = form.nx[k + 1] if k < structure.stages else 0
        for i in range(given_by):
            inside = set(a[row + i].indices)
            assert inside - set(own) == {own.stop + i}
        for i in range(given_by, given_by + form.ng[k]):
            assert set(a[row + i].indices) <= set(own)
        row, column = row + given_by + form.ng[k], own.stop
    assert (row, column) == form.shape
    assert form.is_dynamics.sum() == sum(form.nx)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_points_keep_cost_rows_and_duals(recording: Recording, seed: int) -> None:
    """At any z: both costs, each row's value within its bounds, and A'y of any dual."""
    structure, data = recording.structure, recording.solves[12].data
    random = np.random.default_rng(seed)
    z, y = random.normal(size=data.q.size), random.normal(size=data.lower.size)
    form = OcpForm(structure)
    a = sp.csc_matrix((form.values(data), form.indices, form.indptr), shape=form.shape)
    v = form.point(z)
    h, g = form.cost(data)
    assert 0.5 * v @ (h * v) + g @ v == pytest.approx(objective(data, z), rel=1e-9)
    np.testing.assert_array_equal(form.primal(v), z)

    value, asked = a @ v, structure.matrix_of(data.a_data) @ z
    low, high = form.row_bounds(data)
    least, most = form.bounds(data)
    violated = np.concatenate([low - value, value - high, least - v, v - most])
    reference = np.concatenate([data.lower - asked, asked - data.upper])
    assert max(violated.max(), 0.0) == pytest.approx(max(reference.max(), 0.0), rel=1e-9)

    apart = BoundsApart(structure)
    many, of_rows = apart.rows.matrix(data), y[apart.rows.rows]
    of_bounds = np.where(np.isfinite(apart.bounds(data)).any(axis=0), random.normal(size=z.size), 0)
    np.testing.assert_allclose(
        structure.matrix_of(data.a_data).T @ apart.join(data, of_rows, of_bounds),
        many.T @ of_rows + of_bounds,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("name", ["hpipm", "qpalm", "piqp-multistage"])
def test_random_stage_qps(recording: Recording, name: str) -> None:
    """The pattern of a trip with random costs, and bounds around a random point."""
    structure, data = recording.structure, recording.solves[10].data
    random = np.random.default_rng(5)
    reference, solver = make_solver("clarabel", 1e-10), make_solver(name, 1e-8)
    for backend in (reference, solver):
        backend.setup(structure, data)
    for _ in range(3):
        row = structure.matrix_of(data.a_data) @ random.normal(size=data.q.size)
        equal = data.lower == data.upper
        room = np.where(equal, 0.0, random.uniform(0.01, 2.0, row.size))
        problem = replace(
            data,
            q=random.normal(size=data.q.size),
            hessian=random.uniform(0.01, 1.0, data.q.size),
            lower=np.where(np.isfinite(data.lower), row - room, -np.inf),
            upper=np.where(np.isfinite(data.upper), row + room, np.inf),
        )
        best = reference.solve(problem, None, None)
        found = solver.solve(problem, None, None)
        assert best.status is found.status is Status.SOLVED
        cost = objective(problem, best.primal)
        assert objective(problem, found.primal) == pytest.approx(cost, rel=1e-6)
        # |z - z*|^2 <= 2 (J - J*) / 0.01
        near = np.sqrt(2.0 * 1e-6 * abs(cost) / 0.01)
        np.testing.assert_allclose(found.primal, best.primal, atol=near)
