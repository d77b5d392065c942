"""Coolant to be had in good time: the floor against one written independently, and its use."""

import numpy as np
import pytest

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.safety import T_CL_MARGIN_K
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.pwa import PwaModel
from qpmpc.qp.coolant_floor import CoolantFloor
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.trip import Trip
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle
from qpmpc.verification.independent.equations import Equations
from qpmpc.verification.independent.stage_program import _coolant_floor_degc, horizon

COLD = load_vehicle().with_settings(
    {
        "thermal.cabin_heat_w": 4000.0,
        "thermal.t_amb_degc": -20.0,
        "trip.soc_init": 0.75,
    }
)
OF_QP = ControllerSettings().mh_qp
FROM_ARRIVAL_S = 30.0  # in less an engine at rest loses the margin of 0.3 K


def descent(level_s: int = 400, down_s: int = 900) -> Cycle:
    """Level, then 6 % downhill at 65 km/h, then level."""
    n = level_s + down_s + 300
    speed = np.minimum(np.arange(n + 1.0), 18.0)
    grade = np.zeros(n + 1)
    grade[level_s : level_s + down_s] = -0.06
    return Cycle("descent", np.arange(n + 1.0), speed, grade)


def floor_ahead(car, step: int, soc: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Floors, s from there to the arrival, and the floor of a trip that asks for nothing."""
    model = PwaModel.of(car)
    numbers = qp_parameters(car, model, QpSettings(), ScalingSettings())
    least = numbers["t_min_degc"]
    floor = CoolantFloor(car, model.line, numbers["battery_energy_j"], least)
    stages = Trip(descent(), car).preview(OF_QP.horizon).source.at(step)
    left_s = stages.duration_s.sum() - stages.duration_s.cumsum()
    return floor.at(stages, soc), left_s, least


def floor_at(car, step: int, soc: float) -> np.ndarray:
    return floor_ahead(car, step, soc)[0]


@pytest.mark.parametrize(
    ("step", "soc"), [(0, 0.75), (300, 0.5), (500, 0.6), (900, 0.8), (1500, 0.8)]
)
def test_the_floor_is_that_of_the_equations(step, soc) -> None:
    road = horizon(descent(), COLD, OF_QP, step)
    numbers = qp_parameters(COLD, PwaModel.of(COLD), QpSettings(), ScalingSettings())
    energy_j, least = numbers["battery_energy_j"], numbers["t_min_degc"]
    expected = _coolant_floor_degc(Equations(COLD), road, soc, least, energy_j)
    # K: the plant's fuel is linear between points of 50 W
    np.testing.assert_allclose(floor_at(COLD, step, soc), expected, rtol=0.0, atol=0.01)


def test_the_floor_rises_towards_the_full_battery_and_is_low_again_at_the_end() -> None:
    floor, left_s, least = floor_ahead(COLD, 300, 0.5)
    assert floor[0] == floor[left_s > FROM_ARRIVAL_S].min() == least
    assert floor[-1] == floor.min() < least
    assert floor.max() > least + 5.0


def test_with_the_shipped_settings_nothing_is_asked_before_arrival() -> None:
    floor, left_s, least = floor_ahead(load_vehicle(), 0, 0.6)
    np.testing.assert_array_equal(floor[left_s > FROM_ARRIVAL_S], least)


def test_an_engine_at_rest_may_coast_to_the_limit_at_arrival() -> None:
    """The plant's own coolant, engine off, ends just above what the safety layer keeps."""
    car = load_vehicle()
    trip, plant, ahead_s = Trip(descent(), car), Plant(car), 15
    floor, _, least = floor_ahead(car, trip.steps - ahead_s, 0.6)
    seconds = floor[:ahead_s]
    limit = car.thermal.t_cl_min_degc
    assert limit + T_CL_MARGIN_K < seconds[-1] < limit + 2.0 * T_CL_MARGIN_K
    assert np.all(np.diff(seconds) <= 0.0)
    below = np.flatnonzero(seconds < least)
    assert len(below) > 5  # the margin of 0.3 K is the loss of some ten seconds
    state = PlantState(0.6, float(seconds[below[0]]))
    for k in below[1:]:
        second = trip.steps - ahead_s + int(k)
        demand_w, speed_mps = trip.truth.demand_w[second], trip.truth.speed_mps[second]
        state, _ = plant.step(state, Command(False, 0.0), demand_w, speed_mps)
        assert state.t_cl_degc == pytest.approx(seconds[k], abs=1e-3)


@pytest.mark.slow
@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
def test_a_cold_descent_beside_a_full_battery_in_c_as_in_python() -> None:
    trip = Trip(descent(), COLD)
    in_c, in_python = (drive(trip, made(trip)) for made in (GeneratedController, MhQp))
    # 13 K without the floor; what is left is forecast by the block, and charge that brakes take
    assert in_c.excess.t_cl_k.max() < 1.0
    assert in_c.trajectory.soc.max() == pytest.approx(0.8, abs=1e-3)
    np.testing.assert_allclose(in_c.trajectory.t_cl_degc, in_python.trajectory.t_cl_degc, atol=0.05)
