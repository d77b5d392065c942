"""The tools that put the controller to hostile seconds."""

import numpy as np

from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.checks.safety_checks import FULL_CARS, SEED
from qpmpc.verification.safety.hostile import hostile_drive
from qpmpc.verification.safety.seconds import random_vehicle

STEPS = 700
LIMITS = {
    "engine.start_fuel_g": 0.2,
    "engine.start_energy_j": 3.5e3,
    "engine.min_on_s": 4,
    "engine.min_off_s": 2,
    "engine.ramp_w_per_s": 9.5e3,
    "engine.electric_max_mps": 8.0,
}


def test_hostile_seconds_c_and_python_agree_and_nothing_avoidable_happens() -> None:
    car = load_vehicle("prius-liion").with_settings(LIMITS)
    found = hostile_drive(Trip("nycc", car), STEPS, seed=5)
    assert found.faults == []
    assert max(found.avoidable) <= 1e-6
    assert found.steps == STEPS
    # hostile enough, and yet a plan drives nearly always
    assert {"bad measurement", "bad preview", "bad clock"} <= set(found.flags)
    assert found.planned > 0.9 * STEPS


def test_every_random_car_of_the_full_check_is_one() -> None:
    rng = np.random.default_rng(SEED)
    cars = [random_vehicle(rng) for _ in range(FULL_CARS)]
    # the least coolant and the largest radiator are drawn, but not together
    assert min(car.thermal.heat_capacity_j_per_k for car in cars) < 22e3
    assert max(car.thermal.radiator_w_per_k for car in cars) == 900.0
