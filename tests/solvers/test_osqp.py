"""OSQP as it is used here: fixed arithmetic, no surprises after a bad problem."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.registry import make_controller
from qpmpc.solvers import AdmmSettings, Status
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Trip
from qpmpc.vehicle import PlantState


class Recorded(NamedTuple):
    qp: StageQp
    data: QpData


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """The QP of a planner after its departure on NYCC, with the data of its first second."""
    trip, solves = Trip("nycc"), []
    settings = ControllerSettings().with_settings({"mh_qp.implementation": "python"})
    controller = make_controller("mh-qp", trip, settings)
    assert isinstance(controller, RecedingHorizon)
    planner = controller.planner
    assert isinstance(planner, QpPlanner)
    planner.on_solve = solves.append
    planner.depart(trip.start)
    planner.solve(trip.observation(0, PlantState(0.6, 50.0)))
    return Recorded(planner.qp, solves[-1].data)


def _fresh(recorded, **settings):
    solver = Osqp(AdmmSettings(**settings))
    solver.setup(recorded.qp.structure, recorded.data)
    return solver


def test_every_solve_runs_exactly_k_iterations(recorded):
    solver = _fresh(recorded, iterations=37)
    for _ in range(3):
        assert solver.solve(recorded.data, None, None).iterations == 37
    assert solver.solve(recorded.data, None, None, cold=True).iterations == 4000


def test_same_input_same_bits(recorded):
    a = _fresh(recorded).solve(recorded.data, None, None)
    b = _fresh(recorded).solve(recorded.data, None, None)
    np.testing.assert_array_equal(a.primal, b.primal)
    np.testing.assert_array_equal(a.dual, b.dual)


def test_the_callers_arrays_are_left_alone(recorded):
    data = recorded.data
    before = {f: getattr(data, f).copy() for f in ("hessian", "q", "a_data", "lower", "upper")}
    solver = _fresh(recorded)
    solver.solve(data, None, None)
    for field, value in before.items():
        np.testing.assert_array_equal(getattr(data, field), value)


def test_infeasible_is_not_usable_and_does_not_poison_the_next_solve(recorded):
    data = recorded.data
    good = _fresh(recorded, cold_iterations=8000).solve(data, None, None, cold=True)
    assert good.usable
    lower, upper = data.lower.copy(), data.upper.copy()
    rows = recorded.qp.rows
    last = lower.reshape(-1, rows.count)[-1]
    top = upper.reshape(-1, rows.count)[-1]
    final = rows.first("box_soc")
    last[final], top[final] = 1e4, 1e4 + 1.0  # a final SOC far beyond reach
    solver = _fresh(recorded, cold_iterations=8000)
    bad = solver.solve(replace(data, lower=lower, upper=upper), None, None, cold=True)
    assert bad.status is Status.INFEASIBLE
    assert not bad.usable
    again = solver.solve(data, None, None, cold=True)
    assert again.usable
    np.testing.assert_allclose(again.primal, good.primal, atol=1e-9)


@pytest.mark.parametrize("field", ["q", "a_data", "lower", "upper"])
def test_nan_and_crossed_bounds_are_refused_and_forgotten(recorded, field):
    data, solver = recorded.data, _fresh(recorded)
    spoilt = getattr(data, field).copy()
    spoilt[3] = np.nan
    bad = solver.solve(replace(data, **{field: spoilt}), None, None)
    assert bad.status is Status.FAILED
    assert not bad.usable
    crossed = solver.solve(replace(data, lower=data.upper + 1.0), None, None)
    assert crossed.status is Status.FAILED
    expected = _fresh(recorded).solve(data, None, None)
    np.testing.assert_array_equal(solver.solve(data, None, None).primal, expected.primal)
