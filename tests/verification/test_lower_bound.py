"""The lower bound on fuel: below everything that drives, near the optimum, and not by luck."""

import numpy as np
import pytest

from qpmpc.controllers.base import Controller
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import Command, Plant, load_vehicle
from qpmpc.verification.bounds.lower_bound import lower_bound, stored_energy_j
from qpmpc.verification.bounds.relaxed_trip import relaxed_trip

VEHICLE = load_vehicle("paper-nimh")  # starts cost nothing; `starting` has cars whose do
STEPS = 150


@pytest.fixture(scope="module")
def trip() -> Cycle:
    nycc = load_cycle("nycc")
    part = slice(STEPS + 1)
    return Cycle("nycc-150", nycc.time_s[part], nycc.speed_mps[part], nycc.grade[part])


@pytest.fixture(scope="module")
def bound(trip):
    return lower_bound(trip, VEHICLE)


class Dice(Controller):
    """Throws engine state and power anew every few seconds; the safety layer keeps the limits."""

    name = "dice"

    def __init__(self, trip: Trip, seed: int) -> None:
        super().__init__(trip)
        self._dice = np.random.default_rng(seed)
        self._wish = Command(False, 0.0)

    def step(self, seen) -> Command:
        if seen.step % 7 == 0:
            self._wish = Command(self._dice.random() < 0.3, 25e3 * self._dice.random())
        return self._wish


def priced_g(finished, bound) -> float:
    soc = finished.trajectory.soc
    used = stored_energy_j(VEHICLE, float(soc[0])) - stored_energy_j(VEHICLE, float(soc[-1]))
    return finished.fuel_g + bound.price_g_per_j * used


@pytest.mark.parametrize("seed", range(20))
def test_no_random_drive_is_below_it(trip, bound, seed):
    road = Trip(trip, VEHICLE)
    finished = simulate(road, Dice(road, seed))
    assert not any(finished.summary()["violations"].values())
    assert priced_g(finished, bound) >= bound.fuel_g


@pytest.mark.parametrize("name", ["mh-qp", "rule-based", "ecms"])
def test_no_controller_is_below_it(trip, bound, name):
    assert priced_g(simulate(trip, name, VEHICLE), bound) >= bound.fuel_g


@pytest.fixture(scope="module", params=[(0.3, 0.0), (0.2, 4000.0), None])
def starting(request):
    """Vehicle whose starts take fuel, or fuel and cranking; the default one."""
    if request.param is None:
        return load_vehicle()
    fuel_g, energy_j = request.param
    return VEHICLE.with_settings({"engine.start_fuel_g": fuel_g, "engine.start_energy_j": energy_j})


@pytest.fixture(scope="module")
def starting_bound(trip, starting):
    return lower_bound(trip, starting)


def test_nothing_is_below_it_where_the_engine_must_run_for_the_speed(trip, bound):
    vehicle = VEHICLE.with_settings({"engine.electric_max_mps": 6.0})
    limited = lower_bound(trip, vehicle)
    assert limited.fuel_g > bound.fuel_g
    for name in ("mh-qp", "ecms"):
        run = simulate(trip, name, vehicle)
        fast = run.trajectory.speed_mps > 6.0
        assert fast.sum() > 10
        assert run.trajectory.engine_on[fast].all()
        assert priced_g(run, limited) >= limited.fuel_g


@pytest.mark.parametrize("seed", range(10))
def test_no_random_drive_is_below_it_where_starts_cost_something(
    trip, starting, starting_bound, seed
):
    road = Trip(trip, starting)
    finished = simulate(road, Dice(road, seed))
    assert not any(finished.summary()["violations"].values())
    assert priced_g(finished, starting_bound) >= starting_bound.fuel_g


def test_starts_raise_it_and_nothing_is_below_it(trip, bound, starting, starting_bound):
    """By one start at the least: the engine cannot do without."""
    best = simulate(trip, "mh-qp", starting)
    starts = int(best.trajectory.started.sum())
    assert starts > 0
    assert bound.fuel_g + starting.engine.start_fuel_g < starting_bound.fuel_g
    assert starting_bound.fuel_g <= priced_g(best, starting_bound)
    assert starting_bound.fuel_g > 0.95 * priced_g(best, starting_bound)


def test_the_optimum_is_above_it_where_starts_take_fuel(trip):
    vehicle = VEHICLE.with_settings({"engine.start_fuel_g": 0.3})
    bound = lower_bound(trip, vehicle)
    optimum = simulate(trip, "dp", vehicle, settings={"dp.grid": "quick"})
    assert bound.fuel_g <= priced_g(optimum, bound)


def test_it_is_not_empty_words(trip, bound):
    # On a trip this short one switch of the engine costs more than on a whole cycle.
    assert bound.fuel_g > 0.95 * priced_g(simulate(trip, "mh-qp", VEHICLE), bound)
    assert 0.0 <= bound.numerical_g < 0.01 * bound.fuel_g


def test_what_makes_the_trip_harder_raises_it(trip, bound):
    for harder in ({"thermal.cabin_heat_w": 3000.0}, {"battery.aux_power_w": 800.0}):
        assert lower_bound(trip, VEHICLE.with_settings(harder)).fuel_g > bound.fuel_g


def test_a_start_outside_the_coolant_limits_is_refused(trip):
    with pytest.raises(InputError, match=r"trip\.t_cl_init_degc"):
        lower_bound(trip, VEHICLE.with_settings({"trip.t_cl_init_degc": -7.0}))


def test_stored_energy_is_the_integral_of_the_voltage():
    soc = np.linspace(0.5, 0.7, 20001)
    voltage = Plant(VEHICLE).battery.open_circuit(soc)
    expected = 3600.0 * VEHICLE.battery.capacity_ah * np.trapezoid(voltage, soc)
    found = stored_energy_j(VEHICLE, 0.7) - stored_energy_j(VEHICLE, 0.5)
    assert found == pytest.approx(expected, rel=1e-9)
    assert stored_energy_j(VEHICLE, VEHICLE.battery.soc_min) == 0.0
    assert stored_energy_j(VEHICLE, 0.3) < 0.0


def test_relaxed_trip_is_below_the_bracket_and_integral(trip, bound):
    relaxed = relaxed_trip(trip, VEHICLE)
    assert relaxed.fuel_g == pytest.approx(bound.fuel_g, rel=0.05)
    assert relaxed.integral_share > 0.98
