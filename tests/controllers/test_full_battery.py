"""A second leaves room in the battery for the braking to come."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from short_trip import assert_same_commands, drive_in

from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.full_battery import full_battery_w
from qpmpc.preview.stages import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp.last_run import FUEL_LEAST
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

CAR = load_vehicle("paper-liion")
POLISH, PLANT = Polish(CAR, PwaModel.of(CAR)), Plant(CAR)
PRICES = Prices(fuel=1.0, p_eng=0.0, internal=6e-5)
FULL = CAR.battery.soc_max
ENERGY_J = POLISH.maps.energy_j(FULL)
SECONDS, SPEED_MPS = 20, 10.0
AUX_W = CAR.battery.aux_power_w
BRAKING = [15e3, *[4e3] * 3, *[-12e3] * 10, *[4e3] * 6]


def most_w(net_w, soc: float, fuel: float = 1.0, beyond_j: float = 0.0) -> float:
    """Return the most power; the last second of the short horizon has the room for what follows."""
    count = len(net_w)
    off_w = np.array([POLISH.internal_w(w) for w in net_w])
    zero, rise_j = np.zeros(count), np.zeros(count)
    rise_j[SECONDS - 1] = beyond_j
    trip = Stages(
        zero + 1.0, np.array(net_w), zero + SPEED_MPS, off_w, zero, zero, off_w, zero, zero, rise_j
    )
    seen = Observation(9, soc, 60.0, True, net_w[0] - AUX_W, SPEED_MPS, 9, 10e3)
    prices = PRICES._replace(fuel=fuel)
    return full_battery_w(CAR, POLISH.maps, prices, trip, SECONDS, seen)


@given(
    room=st.floats(0.0, 0.05),
    net_w=st.lists(st.floats(-20e3, 20e3), min_size=SECONDS, max_size=SECONDS),
    beyond_j=st.floats(0.0, 5e4),
)
def test_the_braking_to_come_just_fills_the_battery(room, net_w, beyond_j) -> None:
    """Against the plant: with that power the second ends as far below the limit as braking lifts.

    The least that the engine may give is left to it.
    """
    soc = FULL - room
    found_w = most_w(net_w, soc, beyond_j=beyond_j)
    off_w = np.array([POLISH.internal_w(w) for w in net_w[1:]])
    stored_j = -np.cumsum(off_w)
    highest_j = max(float(stored_j.max()), float(stored_j[-1]) + beyond_j)
    if highest_j <= 0.0:
        assert found_w == np.inf
        return
    least_w = max(CAR.engine.power_min_w, net_w[0] - CAR.battery_discharge_max_w)
    assert found_w >= least_w
    accepted_w = net_w[0] + CAR.battery_charge_max_w
    if least_w < found_w < min(CAR.engine.power_max_w, accepted_w):
        command = Command(True, found_w)
        after, _ = PLANT.step(PlantState(soc, 60.0), command, net_w[0] - AUX_W, SPEED_MPS)
        assert after.soc + highest_j / ENERGY_J == pytest.approx(FULL, abs=1e-6)


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


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, "random-9507-361s", "prius-liion", FULL_TRIP)


def test_a_run_before_braking_charges_no_more_than_braking_leaves_room_for(monkeypatch) -> None:
    """A run of four seconds before it filled the battery: 2 % of the fuel for friction brakes."""
    now = drive("python")
    monkeypatch.setattr("qpmpc.controllers.qp_planner.full_battery_w", lambda *_: np.inf)
    before = drive("python")
    assert now.soc[-1] == pytest.approx(before.soc[-1], abs=1e-4)
    spared_g = before.fuel_g.sum() - now.fuel_g.sum()
    assert spared_g > 0.015 * now.fuel_g.sum()
    # no more than the engine makes of that fuel at its best, a third of its energy
    spared_j = before.p_friction_w.sum() - now.p_friction_w.sum()
    assert 0.0 < spared_j < spared_g * CAR.engine.lhv_j_per_kg * 1e-3 / 2.0


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_runs_as_python_does() -> None:
    runs = [drive(made_in) for made_in in ("python", "c")]
    assert_same_commands(*runs)
