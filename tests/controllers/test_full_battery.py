"""A second leaves room in the battery for the braking to come."""

from dataclasses import replace

import numpy as np
import pytest
from bare_seconds import bare_stages
from hypothesis import given
from hypothesis import strategies as st
from short_trip import assert_same_commands, drive_in

from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.full_battery import full_battery_w
from qpmpc.controllers.last_run import FUEL_LEAST
from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

CAR = load_vehicle("paper-liion")
POLISH, PLANT = Polish(CAR, PwaModel.of(CAR)), Plant(CAR)
FULL = CAR.battery.soc_max
ENERGY_J = POLISH.maps.energy_j(FULL)
SECONDS, SPEED_MPS = 20, 10.0
AUX_W = CAR.battery.aux_power_w
BRAKING = [15e3, *[4e3] * 3, *[-12e3] * 10, *[4e3] * 6]


def most_w(net_w, soc: float, fuel: float = 1.0, beyond_j: float = 0.0) -> float:
    """Return the most power; the last second of the short horizon has the room for what follows."""
    rise_j = np.zeros(len(net_w))
    rise_j[SECONDS - 1] = beyond_j
    trip = replace(bare_stages(POLISH, net_w, speed_mps=SPEED_MPS), rise_j=rise_j)
    seen = Observation(9, soc, 60.0, True, net_w[0] - AUX_W, SPEED_MPS, 9, 10e3)
    return full_battery_w(CAR, POLISH.maps, fuel, trip, SECONDS, seen)


def highest_j(net_w, beyond_j: float) -> float:
    """What braking puts into the battery after the first second, the engine at rest."""
    stored_j = -np.cumsum([POLISH.internal_w(w) for w in net_w[1:]])
    return max(float(stored_j.max()), float(stored_j[-1]) + beyond_j)


def soc_after(soc: float, net_w: float, power_w: float) -> float:
    """SOC that the plant reaches in a second."""
    command = Command(True, power_w)
    after, _ = PLANT.step(PlantState(soc, 60.0), command, net_w - AUX_W, SPEED_MPS)
    return after.soc


@given(
    room=st.floats(0.0, 0.02),
    first_w=st.floats(0.0, 20e3),
    next_w=st.lists(st.floats(-4e3, 3e3), min_size=SECONDS - 1, max_size=SECONDS - 1),
    beyond_j=st.floats(0.0, 1e4),
)
def test_the_braking_to_come_just_fills_the_battery(room, first_w, next_w, beyond_j) -> None:
    """Against the plant: with that power the second ends as far below the limit as braking lifts.

    If the engine can give no less it ends above, if the battery takes no more it ends below.
    """
    soc, net_w = FULL - room, [first_w, *next_w]
    most = most_w(net_w, soc, beyond_j=beyond_j)
    gained_j = highest_j(net_w, beyond_j)
    if gained_j <= 0.0:
        assert most == np.inf
        return
    least_w = max(CAR.engine.power_min_w, first_w - CAR.battery_discharge_max_w)
    accepted_w = min(CAR.engine.power_max_w, first_w + CAR.battery_charge_max_w)
    ends_at = soc_after(soc, first_w, min(most, accepted_w))
    beyond = ends_at + gained_j / ENERGY_J - FULL
    assert most >= least_w
    assert beyond > -1e-6 or most > accepted_w
    assert beyond < 1e-6 or most == least_w


def test_no_room_is_asked_for_below_the_lower_limit() -> None:
    """More braking than the battery holds: an empty one still gets what it lacks."""
    soc = CAR.battery.soc_min + SOC_MARGIN
    battery_j = ENERGY_J * (FULL - CAR.battery.soc_min)
    most = most_w([8e3, *[0.0] * (SECONDS - 1)], soc, beyond_j=2.0 * battery_j)
    assert soc_after(soc, 8e3, most) == pytest.approx(soc, abs=1e-9)


def test_nothing_is_kept_where_nothing_brakes_or_fuel_is_burnt_for_its_heat() -> None:
    soc = FULL - 0.005
    assert most_w([5e3] * SECONDS, soc) == np.inf
    assert most_w(BRAKING, soc) < 15e3
    assert most_w(BRAKING, soc, fuel=0.9 * FUEL_LEAST) == np.inf


def test_braking_beyond_the_short_horizon_counts_with_the_driving_before_it() -> None:
    soc, slow = FULL - 0.01, [15e3] + [2e3] * (SECONDS - 1)
    driven_j = (SECONDS - 1) * POLISH.internal_w(2e3)
    assert most_w(slow, soc, beyond_j=0.9 * driven_j) == np.inf
    none_left_w = most_w(slow, soc, beyond_j=driven_j + 0.01 * ENERGY_J)
    assert none_left_w == pytest.approx(15e3, rel=1e-3)  # all of the demand, no charge


# Four runs end before braking that the short horizon sees, the last of them at a full battery.
FULL_TRIP = {
    "thermal.t_amb_degc": -10.743762,
    "trip.soc_init": 0.772355,
    "trip.t_cl_init_degc": 75.658528,
}


def drive() -> Trajectory:
    return drive_in("python", "random-9507-361s", "prius-liion", FULL_TRIP)


def test_a_run_before_braking_charges_no_more_than_braking_leaves_room_for(monkeypatch) -> None:
    """A run of four seconds before it filled the battery: 2 % of the fuel for friction brakes."""
    now = drive()
    monkeypatch.setattr("qpmpc.controllers.coming_second.full_battery_w", lambda *_: np.inf)
    before = drive()
    assert now.soc[-1] == pytest.approx(before.soc[-1], abs=1e-4)
    spared_g = before.fuel_g.sum() - now.fuel_g.sum()
    assert spared_g > 0.015 * now.fuel_g.sum()
    # no more than an engine can make of that fuel: half of its energy is out of reach
    spared_j = before.p_friction_w.sum() - now.p_friction_w.sum()
    assert 0.0 < spared_j < spared_g * CAR.engine.lhv_j_per_g / 2.0


FREE_TRIP = {
    "thermal.t_amb_degc": 1.871293,
    "trip.soc_init": 0.784413,
    "trip.t_cl_init_degc": 80.220693,
}


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("trip", "vehicle", "start"),
    [
        ("random-9507-361s", "prius-liion", FULL_TRIP),
        ("random-9585-376s", "paper-liion", FREE_TRIP),
    ],
)
def test_c_runs_as_python_does(trip, vehicle, start) -> None:
    runs = [drive_in(made_in, trip, vehicle, start) for made_in in ("python", "c")]
    assert_same_commands(*runs)
