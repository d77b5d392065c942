"""What the plan of departure expects is the trip's fuel, where the plan is a good one."""

import numpy as np
import pytest

from qpmpc.comparison import compare
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.qp.expectation import expectation
from qpmpc.qp.rows import Var
from qpmpc.results import OFF_EXPECTED_PERCENT
from qpmpc.simulation import simulate
from qpmpc.trip import Trip


@pytest.mark.parametrize("cycle", ["nycc", "udds", "hwfet"])
def test_a_free_engine_burns_what_was_expected(cycle):
    """Plans of the shipped cycles are within 0.3 % of the optimum, and so is what they expect."""
    run = simulate(cycle, "mh-qp", "paper-nimh")
    assert run.fuel_off_expected_percent == pytest.approx(0.0, abs=0.3)
    assert run.summary()["fuel_expected_g"] == run.fuel_expected_g
    assert not run.doubt


def test_a_mean_of_the_demand_promises_too_much_and_the_run_says_so():
    """A mean demand (paper, 20 s blocks) hides stop and go: the plan is far below the optimum."""
    run = simulate("nycc", "mh-qp-paper", "paper-nimh")
    assert run.fuel_off_expected_percent > 3.0
    (said,) = [line for line in run.summary()["remarks"] if "expected" in line]
    assert said == run.doubt
    assert "above what the plan at departure expected" in said
    assert said in compare("nycc", ["mh-qp-paper"], "paper-nimh").remarks()


def test_a_trip_other_than_the_forecast_says_so():
    """A motorway forecast for a drive in town."""
    run = simulate("nycc", "mh-qp", forecast=Trip("hwfet").cycle)
    assert abs(run.fuel_off_expected_percent) > OFF_EXPECTED_PERCENT
    assert run.doubt


@pytest.mark.parametrize(
    ("controller", "settings"),
    [("rule-based", {}), ("baseline-mpc", {}), ("mh-qp", {"mh_qp.prepared": False})],
)
def test_no_plan_to_the_arrival_expects_nothing(controller, settings):
    run = simulate("random-3-187s", controller, settings=settings)
    assert run.fuel_expected_g is None
    assert run.summary()["fuel_off_expected_percent"] is None
    assert not run.doubt


def test_it_is_the_sum_over_the_plan_and_the_same_in_c():
    trip = Trip("random-3-187s", "prius-liion")
    python = MhQp(trip)
    python.depart()
    plan = python.planner.last
    x, h = plan.x, plan.stages.duration_s
    alpha = python.planner.model.alpha(x[:, Var.T_CL])  # at the ends: T^ is near them
    fuel_g = (h * alpha * x[:, Var.FUEL]).sum() + 0.2 * x[:, Var.START].sum()
    assert python.expects.fuel_g == pytest.approx(fuel_g, rel=2e-3)
    assert python.expects.soc_end == x[-1, Var.SOC]
    run = simulate(trip, "mh-qp", settings={"mh_qp.implementation": "c"})
    assert run.expects == pytest.approx(python.expects, rel=1e-6)
    layout, model = python.planner.of_qp.horizon, python.planner.model
    assert expectation(trip, layout, model, plan.stages, np.full_like(x, np.nan)) is None
