"""Safety layer: whatever goes in, no command keeps the limits of the next second better."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from plain import plain_car

from qpmpc.controllers.safety import SafetyLayer
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState
from qpmpc.verification.safety.promise import promise

CAR = plain_car()
PLANT = Plant(CAR)
SAFETY = SafetyLayer(PLANT)
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True)
OFF = Command(False, 0.0)


def test_no_command_exceeds_the_limits_by_less() -> None:
    found = promise(cars=12, seed=3)
    assert found.beyond_w <= 1e-9
    assert found.power_w <= 1e-6
    assert found.soc <= 1e-12
    assert found.t_cl_k <= 1e-9
    assert found.cut_short == 0
    assert found.held > 200
    # in most seconds there is something to choose: the comparison means something
    assert 0.5 * found.seconds < found.kept < 0.9 * found.seconds


@given(
    on=st.booleans(),
    p_eng_w=ANY_NUMBER,
    soc=st.floats(0.0, 1.0),
    t_cl_degc=st.floats(-60.0, 130.0),
    demand_w=st.floats(-1e6, 1e6),
    speed_mps=st.floats(0.0, 90.0),
    running=st.booleans(),
)
def test_any_wish_becomes_a_command_in_range(
    on, p_eng_w, soc, t_cl_degc, demand_w, speed_mps, running
) -> None:
    seen = Observation(0, soc, t_cl_degc, running, demand_w, speed_mps)
    command = SAFETY.admissible(Command(on, p_eng_w), seen)
    assert isinstance(command.engine_on, bool)
    assert math.isfinite(command.p_eng_w)
    assert 0.0 <= command.p_eng_w <= CAR.engine.power_max_w
    assert command.engine_on or command.p_eng_w == 0.0


def test_an_admissible_wish_is_granted() -> None:
    seen = Observation(0, 0.6, 60.0, True, 10e3, 15.0)
    assert SAFETY.admissible(Command(True, 12e3), seen) == Command(True, 12e3)
    assert SAFETY.admissible(OFF, seen) == OFF


@given(demand_w=st.floats(-60e3, 20e3), speed_mps=st.floats(0.0, 35.0), soc=st.floats(0.45, 0.8))
@example(demand_w=-30e3, speed_mps=18.0, soc=0.8)  # the brakes leave room for the engine
def test_coolant_stays_above_its_lower_limit_in_any_long_descent(demand_w, speed_mps, soc) -> None:
    state = PlantState(soc, 40.1)
    for _ in range(60):
        seen = Observation(0, state.soc, state.t_cl_degc, state.engine_on, demand_w, speed_mps)
        state, _ = PLANT.step(state, SAFETY.admissible(OFF, seen), demand_w, speed_mps)
    assert state.t_cl_degc >= 40.0


def test_an_engine_on_at_too_low_power_is_raised() -> None:
    plant = Plant(CAR.with_settings({"thermal.t_amb_degc": -20.0, "thermal.cabin_heat_w": 4e3}))
    seen = Observation(0, 0.6, 40.01, True, 5e3, 15.0)
    command = SafetyLayer(plant).admissible(Command(True, 0.0), seen)
    after, _ = plant.step(PlantState(0.6, 40.01, True), command, 5e3, 15.0)
    assert command.p_eng_w > 0.0  # idling would not do
    assert after.t_cl_degc >= 40.0


@pytest.mark.parametrize(("soc", "t_cl_degc"), [(0.39, 60.0), (0.81, 60.0), (0.6, 38.0), (0.6, 92)])
def test_from_outside_it_leads_back_for_good(soc, t_cl_degc) -> None:
    state, outside = PlantState(soc, t_cl_degc), []
    for _ in range(400):
        seen = Observation(0, state.soc, state.t_cl_degc, state.engine_on, 3e3, 12.0)
        state, _ = PLANT.step(state, SAFETY.admissible(OFF, seen), 3e3, 12.0)
        outside.append(max(0.4 - state.soc, state.soc - 0.8, 0.0))
        outside[-1] += max(40.0 - state.t_cl_degc, state.t_cl_degc - 90.0, 0.0)
    assert outside[-1] == 0.0
    assert outside == sorted(outside, reverse=True)


def test_start_fuel_warms_the_coolant_too() -> None:
    plant = Plant(CAR.with_settings({"engine.start_fuel_g": 0.5}))
    state = PlantState(0.6, 89.9, False)
    seen = Observation(0, state.soc, state.t_cl_degc, False, 20e3, 30.0)
    command = SafetyLayer(plant).admissible(Command(True, 60e3), seen)
    after, _ = plant.step(state, command, 20e3, 30.0)
    assert after.t_cl_degc <= 90.0


STARTING = CAR.with_settings(
    {
        "engine.start_energy_j": 4e3,
        "engine.ramp_w_per_s": 9.5e3,
        "engine.min_on_s": 4,
        "engine.min_off_s": 3,
    }
)
LAYER = SafetyLayer(Plant(STARTING))


def test_a_start_leaves_the_battery_the_power_that_cranks_the_engine() -> None:
    # 27 kW of battery: off gives 24.4 kW, a start at 0 W would give 28.4 kW
    stopped = Observation(0, 0.6, 60.0, False, 24e3, 15.0)
    assert LAYER.admissible(OFF, stopped) == OFF
    command = LAYER.admissible(Command(True, 0.0), stopped)
    assert command.p_eng_w == pytest.approx(24.4e3 + 4e3 - 27e3 + 0.1)


@given(soc=st.floats(0.79, 0.85), demand_w=st.floats(-5e3, 10e3), speed_mps=st.floats(0.0, 30.0))
@example(soc=0.805, demand_w=0.0, speed_mps=0.0)
def test_no_engine_is_started_only_to_discharge_a_full_battery(soc, demand_w, speed_mps) -> None:
    seen = Observation(0, soc, 60.0, False, demand_w, speed_mps)
    assert LAYER.admissible(OFF, seen) == OFF


def test_power_rises_by_the_ramp_from_the_power_before() -> None:
    running = Observation(0, 0.6, 60.0, True, 20e3, 15.0, 9, 5e3)
    stopped = running._replace(engine_on=False)  # the power before is 0, whatever else is told
    unknown = running._replace(p_eng_before_w=math.inf)
    wish = Command(True, 40e3)
    for seen, most_w in ((running, 14.5e3 - 0.1), (stopped, 9.5e3 - 0.1), (unknown, 40e3)):
        assert LAYER.admissible(wish, seen).p_eng_w == pytest.approx(most_w)


def test_the_shortest_run_and_rest_last_as_long_as_no_limit_is_at_stake() -> None:
    running = Observation(0, 0.6, 60.0, True, 5e3, 15.0, 3, 7e3)
    assert LAYER.admissible(OFF, running) == Command(True, 7e3)  # as in the last second
    assert LAYER.admissible(Command(True, 2e3), running) == Command(True, 2e3)
    assert LAYER.admissible(OFF, running._replace(engine_for_s=4)) == OFF
    assert LAYER.admissible(OFF, running._replace(t_cl_degc=91.0)) == OFF  # too hot
    resting = Observation(0, 0.6, 60.0, False, 5e3, 15.0, 2)
    wish = Command(True, 8e3)
    assert LAYER.admissible(wish, resting) == OFF
    assert LAYER.admissible(wish, resting._replace(engine_for_s=3)) == wish
    emptied = LAYER.admissible(wish, resting._replace(soc=0.4))
    assert emptied.engine_on
    assert 9.4e3 < emptied.p_eng_w < 9.5e3  # demand, auxiliaries and its own cranking


def test_an_engine_found_running_at_a_power_that_is_not_known_idles_to_the_end() -> None:
    seen = Observation(0, 0.6, 60.0, True, 5e3, 15.0, 1)
    assert LAYER.admissible(OFF, seen) == Command(True, 0.0)
