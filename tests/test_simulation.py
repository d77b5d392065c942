"""Names of everything that can drive a cycle; plans replayed on the plant."""

import numpy as np
import pytest

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.registry import CONTROLLERS, PLANNERS, check_controllers, controller_names
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp


@pytest.fixture
def trip() -> Cycle:
    speed = [0.0, 3.0, 6.0, 9.0, 12.0, 14.0, 14.0, 14.0, 14.0, 12.0, 8.0, 4.0, 0.0]
    return Cycle.from_samples("trip", 2.0 * np.arange(len(speed)), speed)


def test_every_controller_can_be_run_and_the_default_is_first():
    assert controller_names()[0] == "mh-qp"
    assert set(controller_names()) == {*CONTROLLERS.names(), *PLANNERS.names()}
    assert "dp" in controller_names()
    check_controllers(controller_names())


def test_unknown_name(trip):
    with pytest.raises(InputError, match=r"'pid'.*mh-qp.*dp"):
        simulate(trip, "pid", load_vehicle())


def test_progress_reaches_the_end(trip):
    seen: list[tuple[int, int]] = []
    simulate(trip, "rule-based", load_vehicle(), progress=lambda *done: seen.append(done))
    assert seen[-1] == (trip.steps, trip.steps)


def test_plan_of_dynamic_programming_is_replayed_exactly(trip, tmp_path, monkeypatch):
    """The same plant is under both, so state and fuel agree to rounding."""
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    vehicle, coarse = load_vehicle(), DpSettings(soc_step=0.01, power_step_w=2000.0)
    plan = solve_dp(trip, vehicle, coarse)
    settings = ControllerSettings().with_section("dp", coarse)
    replayed = simulate(trip, "dp", vehicle, settings=settings)
    assert replayed.controller == "dp"
    np.testing.assert_allclose(replayed.trajectory.soc, plan.soc, atol=1e-9)
    np.testing.assert_allclose(replayed.trajectory.t_cl_degc, plan.t_cl_degc, atol=1e-6)
    assert replayed.fuel_g == pytest.approx(plan.fuel_total_g, rel=1e-9)
    assert np.isnan(replayed.trajectory.step_time_s).all()
