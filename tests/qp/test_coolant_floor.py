"""Coolant to be had in good time: the floor against one written independently, and its use."""

import numpy as np
import pytest

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.pwa import PwaModel
from qpmpc.qp.coolant_floor import CoolantFloor
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
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


def descent(level_s: int = 400, down_s: int = 900) -> Cycle:
    """Level, then 6 % downhill at 65 km/h, then level."""
    n = level_s + down_s + 300
    speed = np.minimum(np.arange(n + 1.0), 18.0)
    grade = np.zeros(n + 1)
    grade[level_s : level_s + down_s] = -0.06
    return Cycle("descent", np.arange(n + 1.0), speed, grade)


def floor_at(car, step: int, soc: float) -> np.ndarray:
    model = PwaModel.of(car)
    numbers = qp_parameters(car, model, QpSettings(), ScalingSettings())
    floor = CoolantFloor(car, model.line, numbers["battery_energy_j"], numbers["t_min_degc"])
    return floor.at(Trip(descent(), car).preview(OF_QP.horizon).source.at(step), soc)


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
    floor = floor_at(COLD, 300, 0.5)
    assert floor[0] == floor[-1] == floor.min()
    assert floor.max() > floor[-1] + 5.0


def test_with_the_shipped_settings_nothing_is_asked() -> None:
    floor = floor_at(load_vehicle(), 0, 0.6)
    np.testing.assert_array_equal(floor, floor[0])


@pytest.mark.slow
@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
def test_a_cold_descent_beside_a_full_battery_in_c_as_in_python() -> None:
    trip = Trip(descent(), COLD)
    in_c, in_python = (drive(trip, made(trip)) for made in (GeneratedController, MhQp))
    # 13 K without the floor; what is left is forecast by the block, and charge that brakes take
    assert in_c.excess.t_cl_k.max() < 1.0
    assert in_c.trajectory.soc.max() == pytest.approx(0.8, abs=1e-3)
    np.testing.assert_allclose(in_c.trajectory.t_cl_degc, in_python.trajectory.t_cl_degc, atol=0.05)
