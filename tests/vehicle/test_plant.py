"""The plant: its books balance, and it does what its closed forms say."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain import plain_car

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.vehicle import Command, Plant, PlantState, demand_w, load_vehicle
from qpmpc.vehicle.demand import tractive_force_n
from qpmpc.vehicle.plant import BOILING_DEGC, LONG_AGO_S
from qpmpc.verification.independent.equations import Equations

PLANT = Plant(plain_car())
STARTING = Plant(
    plain_car().with_settings(
        {"engine.start_fuel_g": 0.2, "engine.start_energy_j": 3.5e3, "engine.ramp_w_per_s": 9.5e3}
    )
)
BALANCE = 1e-9  # relative to the power turned over in the step, as promised in the docs


@given(
    plant=st.sampled_from([PLANT, STARTING]),
    soc=st.floats(0.0, 1.0),
    t_cl_degc=st.floats(-20.0, 135.0),
    on=st.booleans(),
    p_eng_w=st.floats(0.0, 71e3),
    demand=st.floats(-150e3, 200e3),
    speed_mps=st.floats(0.0, 40.0),
)
def test_energy_is_conserved_in_every_step(plant, soc, t_cl_degc, on, p_eng_w, demand, speed_mps):
    state = PlantState(soc, t_cl_degc)
    after, f = plant.step(state, Command(on, p_eng_w if on else 0.0), demand, speed_mps)
    battery, thermal = PLANT.vehicle.battery, PLANT.vehicle.thermal
    assert f.cranking_w == (plant.vehicle.engine.start_energy_j if on else 0.0)
    current = f.internal_w / PLANT.battery.open_circuit.at(soc)
    resistance = (PLANT.battery.discharge if f.p_bat_w >= 0 else PLANT.battery.charge).at(soc)
    joule_w = resistance * current**2
    stored_w = thermal.heat_capacity_j_per_k * (after.t_cl_degc - t_cl_degc)
    chemical_w = f.fuel_w + f.internal_w
    work_w = demand + battery.aux_power_w + f.cranking_w + f.p_friction_w - f.p_missing_w
    lost_w = f.exhaust_w + f.air_w + f.radiator_w + f.cabin_w + f.boiling_w
    heat_w = joule_w + lost_w + stored_w
    turnover = abs(f.fuel_w) + abs(f.internal_w) + abs(demand) + 1e3
    assert chemical_w == pytest.approx(work_w + heat_w, abs=BALANCE * turnover + 1e-6)
    drawn_w = (soc - after.soc) * PLANT.battery.charge_c * PLANT.battery.open_circuit.at(soc)
    assert drawn_w == pytest.approx(f.internal_w, abs=BALANCE * turnover + 1e-5)


@given(
    soc=st.floats(0.0, 1.0),
    t_cl_degc=st.floats(-20.0, 130.0),
    command=st.builds(Command, st.booleans(), st.floats(-1e6, 1e6)),
    demand=st.floats(-1e6, 1e6),
    speed_mps=st.floats(0.0, 60.0),
)
def test_states_stay_physical_whatever_is_asked(soc, t_cl_degc, command, demand, speed_mps):
    after, f = PLANT.step(PlantState(soc, t_cl_degc), command, demand, speed_mps)
    assert 0.0 <= after.soc <= 1.0
    coldest = min(t_cl_degc, PLANT.vehicle.thermal.t_amb_degc)
    assert coldest - 1e-9 <= after.t_cl_degc <= BOILING_DEGC + 1e-9
    assert min(f.cabin_w, f.boiling_w) >= 0.0
    within = -25e3 - 1e-6 <= f.p_bat_w <= 27e3 + 1e-6
    assert within or f.power_excess_w > 0.0


def test_a_battery_gives_no_more_than_it_holds():
    after, f = PLANT.step(PlantState(1e-4, 50.0), Command(False, 0.0), 20e3, 20.0)
    assert after.soc == pytest.approx(0.0, abs=1e-15)
    assert f.p_missing_w == pytest.approx(20.4e3 - f.p_bat_w)
    assert f.p_missing_w > 19e3


def test_discharge_lowers_soc_and_the_engine_burns_only_when_on():
    state = PLANT.initial_state()
    after, flows = PLANT.step(state, Command(False, 0.0), 5e3, 10.0)
    assert after.soc < state.soc
    assert flows.fuel_g == 0.0
    _, idle = PLANT.step(state, Command(True, 0.0), 5e3, 10.0)
    assert idle.fuel_g > 0.0  # engine on at zero power is not off


@pytest.mark.parametrize(
    ("t_amb_degc", "seconds"), [(-15.0, 626), (-7.0, 654), (0.0, 680), (10.0, 723)]
)
def test_coolant_cools_as_the_differential_equation_says(t_amb_degc, seconds):
    # C dT/dt = -UA (T - T_amb) - Q: T falls from 60 to 40 C in a time known in closed form.
    vehicle = plain_car().with_settings(
        {"thermal.t_amb_degc": t_amb_degc, "trip.t_cl_init_degc": 60.0}
    )
    plant, speed_mps = Plant(vehicle), 8.0
    th = vehicle.thermal
    ua = th.ua0_w_per_k + th.ua1_w_per_k_per_mps * speed_mps
    sink = t_amb_degc - th.cabin_heat_w / ua
    exact = th.heat_capacity_j_per_k / ua * math.log((60.0 - sink) / (40.0 - sink))
    state, steps = plant.initial_state(), 0
    while state.t_cl_degc > 40.0:
        state, _ = plant.step(state, Command(False, 0.0), 0.0, speed_mps)
        steps += 1
    assert steps == pytest.approx(exact, abs=2)
    assert steps == pytest.approx(seconds, abs=2)  # the model's published figures


def test_braking_beyond_the_charge_limit_goes_to_the_friction_brakes():
    battery = PLANT.vehicle.battery
    _, f = PLANT.step(PlantState(0.6, 50.0), Command(False, 0.0), -40e3, 20.0)
    assert f.p_bat_w == pytest.approx(-battery.power_charge_max_w)
    assert f.p_friction_w == pytest.approx(40e3 - battery.aux_power_w - 25e3)
    assert f.power_excess_w == 0.0


def test_a_full_battery_takes_no_more_than_fills_it():
    soc_max = PLANT.vehicle.battery.soc_max
    after, f = PLANT.step(PlantState(soc_max - 1e-4, 50.0), Command(False, 0.0), -20e3, 20.0)
    assert after.soc <= soc_max + 1e-12
    assert f.p_friction_w > 0.0


def test_commands_beyond_the_limits_are_reported():
    _, f = PLANT.step(PlantState(0.6, 50.0), Command(True, 80e3), 50e3, 20.0)
    assert f.power_excess_w >= 9e3
    _, f = PLANT.step(PlantState(0.6, 50.0), Command(False, 0.0), 40e3, 20.0)
    assert f.power_excess_w == pytest.approx(40e3 + 400.0 - 27e3)


def test_start_fuel_is_charged_once_a_start():
    plant = Plant(plain_car().with_settings({"engine.start_fuel_g": 0.5}))
    first, a = plant.step(PlantState(0.6, 50.0), Command(True, 5e3), 5e3, 5.0)
    _, b = plant.step(
        PlantState(0.6, 50.0, engine_on=first.engine_on), Command(True, 5e3), 5e3, 5.0
    )
    assert a.fuel_g - b.fuel_g == pytest.approx(0.5)
    assert (a.started, b.started) == (True, False)


def test_cranking_takes_its_energy_from_the_battery_in_the_second_of_a_start_only():
    _, still = STARTING.step(PlantState(0.6, 50.0), Command(False, 0.0), 5e3, 5.0)
    first, start = STARTING.step(PlantState(0.6, 50.0), Command(True, 5e3), 5e3, 5.0)
    _, after = STARTING.step(first, Command(True, 5e3), 5e3, 5.0)
    assert [f.cranking_w for f in (still, start, after)] == [0.0, 3.5e3, 0.0]
    assert start.p_bat_w == pytest.approx(400.0 + 3.5e3)
    assert after.p_bat_w == pytest.approx(400.0)


def test_while_braking_cranking_takes_what_the_brakes_would_have_taken():
    # 30 kW of braking, 25 kW at most into the battery: the brakes take the rest
    _, still = STARTING.step(PlantState(0.6, 50.0), Command(False, 0.0), -30e3, 15.0)
    _, start = STARTING.step(PlantState(0.6, 50.0), Command(True, 0.0), -30e3, 15.0)
    assert still.p_friction_w == pytest.approx(30e3 - 400.0 - 25e3)
    assert start.p_friction_w == pytest.approx(30e3 - 400.0 - 25e3 - 3.5e3)
    assert start.p_bat_w == still.p_bat_w == pytest.approx(-25e3)


def test_power_rises_no_faster_than_the_ramp_and_falls_at_once():
    state, powers, excess = PlantState(0.6, 60.0), [], []
    for wanted_w in (20e3, 20e3, 20e3, 2e3, 20e3):
        state, f = STARTING.step(state, Command(True, wanted_w), 20e3, 20.0)
        powers.append(f.p_eng_w)
        excess.append(f.power_excess_w)
        assert state.p_eng_w == f.p_eng_w
    assert powers == pytest.approx([9.5e3, 19e3, 20e3, 2e3, 11.5e3])
    assert excess == pytest.approx([10.5e3, 1e3, 0.0, 0.0, 8.5e3])
    stopped, _ = STARTING.step(state, Command(False, 0.0), 5e3, 20.0)
    _, again = STARTING.step(stopped, Command(True, 20e3), 5e3, 20.0)
    assert (stopped.p_eng_w, again.p_eng_w) == (0.0, 9.5e3)  # from 0 again


def test_the_plant_counts_the_seconds_since_the_engine_started_or_stopped():
    state, counts = PLANT.initial_state(), []
    assert state.engine_for_s == LONG_AGO_S  # nothing holds it at departure
    for on in (False, True, True, True, False, False, True):
        state, _ = PLANT.step(state, Command(on, 0.0), 0.0, 0.0)
        counts.append(state.engine_for_s)
    assert counts == [LONG_AGO_S, 1, 2, 3, 1, 2, 1]


def test_demand_at_constant_speed_is_the_road_load():
    v = np.full(11, 20.0)
    cycle = Cycle("constant", np.arange(11.0), v, np.zeros(11))
    force = 81.278 + 2.93982 * 20.0 + 0.307004 * 400.0
    np.testing.assert_allclose(demand_w(cycle, plain_car()), force * 20.0 / 0.88, rtol=1e-12)


@pytest.mark.parametrize(("name", "mean_kw"), [("nycc", 0.96), ("nedc-truncated", 4.01)])
def test_mean_demand_of_the_winter_cycles(name, mean_kw):
    mean = demand_w(load_cycle(name), plain_car()).mean() / 1e3
    assert mean == pytest.approx(mean_kw, abs=0.006)  # rounding of the published figure


def test_road_load_in_the_cold_is_that_of_the_cold_test():
    """EPA's coefficients of the 2016 Prius at -7 C, from those at 24 C and the share per K."""
    cold = plain_car().with_settings({"chassis.road_load_share_per_k": 0.00358})
    speed, level = np.array([5.0, 15.0, 30.0]), np.zeros(3)
    force = tractive_force_n(cold.chassis, -7.0, speed, level, level)
    epa = 90.308 + 3.26639 * speed + 0.341127 * speed**2
    np.testing.assert_allclose(force, epa, rtol=5e-4)  # the three factors differ by as much
    warm = tractive_force_n(cold.chassis, 30.0, speed, level, level)
    np.testing.assert_allclose(
        warm, tractive_force_n(cold.chassis, 24.0, speed, level, level), rtol=1e-12
    )


def test_friction_brakes_take_over_at_low_speed():
    blended = plain_car().with_settings(
        {"chassis.regen_from_mps": 1.0, "chassis.regen_full_mps": 3.0}
    )
    speed = np.arange(10.0, -0.1, -1.0)  # mean speeds 9.5 .. 0.5
    cycle = Cycle("stop", np.arange(11.0), speed, np.zeros(11))
    whole, part = demand_w(cycle, plain_car()), demand_w(cycle, blended)
    mean = cycle.step_speed_mps
    np.testing.assert_array_equal(part[mean >= 3.0], whole[mean >= 3.0])
    np.testing.assert_allclose(part[mean == 1.5], 0.25 * whole[mean == 1.5])
    assert np.all(part[mean <= 1.0] == 0.0)
    speeding_up = Cycle("go", np.arange(11.0), speed[::-1].copy(), np.zeros(11))
    np.testing.assert_array_equal(
        demand_w(speeding_up, plain_car()), demand_w(speeding_up, blended)
    )


@pytest.mark.parametrize("name", ["sonata-hybrid", "prius-prime"])
def test_the_independent_equations_ask_for_the_same_power(name):
    vehicle = load_vehicle(name)
    cycle = load_cycle("nycc")
    np.testing.assert_allclose(
        Equations(vehicle).demand_w(cycle), demand_w(cycle, vehicle), rtol=1e-9, atol=1e-6
    )


def test_climbing_costs_the_potential_energy():
    vehicle = plain_car()
    chassis = vehicle.chassis
    flat = Cycle("flat", np.arange(11.0), np.full(11, 15.0), np.zeros(11))
    hill = Cycle("hill", np.arange(11.0), np.full(11, 15.0), np.full(11, 0.05))
    extra_w = (demand_w(hill, vehicle) - demand_w(flat, vehicle)) * chassis.eta_drive
    climb_mps = 15.0 * 0.05 / math.sqrt(1.0 + 0.05**2)
    np.testing.assert_allclose(extra_w, chassis.mass_kg * 9.81 * climb_mps, rtol=1e-9)
