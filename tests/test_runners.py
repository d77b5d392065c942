"""Names of everything that can drive a cycle; plans replayed on the plant."""

import numpy as np
import pytest

from qpmpc.controllers.factory import ControllerSettings, controller_names
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.runners import check_names, run, run_names
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp


@pytest.fixture
def trip() -> Cycle:
    speed = [0.0, 3.0, 6.0, 9.0, 12.0, 14.0, 14.0, 14.0, 14.0, 12.0, 8.0, 4.0, 0.0]
    return Cycle.from_samples("trip", 2.0 * np.arange(len(speed)), speed)


def test_every_controller_can_be_run_and_the_default_is_first():
    assert run_names()[0] == "mh-qp"
    assert set(controller_names()) < set(run_names())
    assert "dp" in run_names()
    check_names(run_names())


def test_unknown_name(trip):
    with pytest.raises(InputError, match=r"'pid'.*mh-qp.*dp"):
        run(trip, "pid", load_vehicle())


def test_progress_reaches_the_end(trip):
    seen: list[tuple[int, int]] = []
    run(trip, "rule-based", load_vehicle(), progress=lambda *done: seen.append(done))
    assert seen[-1] == (trip.steps, trip.steps)


def test_plan_of_dynamic_programming_is_replayed_exactly(trip, tmp_path, monkeypatch):
    """The same plant is under both, so state and fuel agree to rounding."""
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    vehicle, coarse = load_vehicle(), DpSettings(soc_step=0.01, power_step_w=2000.0)
    plan = solve_dp(trip, vehicle, coarse)
    replayed = run(trip, "dp", vehicle, ControllerSettings(dp=coarse))
    assert replayed.controller == "dp"
    np.testing.assert_allclose(replayed.trajectory.soc, plan.soc, atol=1e-9)
    np.testing.assert_allclose(replayed.trajectory.t_cl_degc, plan.t_cl_degc, atol=1e-6)
    assert replayed.fuel_g == pytest.approx(plan.fuel_total_g, rel=1e-9)
    assert np.isnan(replayed.trajectory.step_time_s).all()
