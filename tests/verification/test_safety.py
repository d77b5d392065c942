"""The tools that put the controller to hostile seconds and random trips."""

import numpy as np

from qpmpc.trip import Trip
from qpmpc.verification.checks.safety_checks import FULL_CARS, SEED
from qpmpc.verification.safety.hostile import hostile_drive
from qpmpc.verification.safety.random_trips import STEEPEST, drive_one, random_trip
from qpmpc.verification.safety.seconds import random_vehicle

STEPS = 700


def test_hostile_seconds_c_and_python_agree_and_nothing_avoidable_happens() -> None:
    found = hostile_drive(Trip("nycc", "prius-liion"), STEPS, seed=5)
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


def test_random_trips_are_seeded_and_as_described() -> None:
    one, settings, kind = random_trip(3)
    again, same, _ = random_trip(3)
    assert one.same_as(again)
    assert settings == same
    assert np.abs(one.cycle.grade).max() <= STEEPEST
    assert 0.41 <= one.vehicle.trip.soc_init <= 0.79
    assert isinstance(kind, str)


def test_a_random_trip_is_driven() -> None:
    outcome = drive_one(8)
    assert not outcome.error
    assert outcome.row is not None
    assert outcome.row["violations"]["soc"] == outcome.row["violations"]["power_w"] == 0.0
