"""Safety layer: whatever goes in, an admissible command comes out."""

import math

from hypothesis import given
from hypothesis import strategies as st

from qpmpc.controllers.safety import SafetyLayer
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

PLANT = Plant(load_vehicle())
SAFETY = SafetyLayer(PLANT)
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True)


@given(
    on=st.booleans(),
    p_eng_w=ANY_NUMBER,
    soc=st.floats(0.35, 0.85),
    t_cl_degc=st.floats(-20.0, 95.0),
    demand_w=st.floats(-60e3, 90e3),
    speed_mps=st.floats(0.0, 45.0),
)
def test_any_wish_becomes_an_admissible_command(on, p_eng_w, soc, t_cl_degc, demand_w, speed_mps):
    seen = Observation(0, soc, t_cl_degc, False, demand_w, speed_mps)
    command = SAFETY.admissible(Command(on, p_eng_w), seen)
    assert math.isfinite(command.p_eng_w)
    assert 0.0 <= command.p_eng_w <= PLANT.vehicle.engine.power_max_w
    assert command.engine_on or command.p_eng_w == 0.0
    # Within what engine and battery can give together, no power limit is exceeded.
    battery = PLANT.vehicle.battery
    reach = PLANT.vehicle.engine.power_max_w
    if soc >= battery.soc_min + 0.01:  # a second of full power takes some 0.006
        reach += battery.power_discharge_max_w
    if demand_w + battery.aux_power_w <= reach and soc < battery.soc_max - 0.01:
        _, flows = PLANT.step(PlantState(soc, t_cl_degc), command, demand_w, speed_mps)
        assert flows.power_excess_w == 0.0


@given(demand_w=st.floats(-20e3, 70e3), soc=st.floats(0.4, 0.43), p=st.floats(0.0, 71e3))
def test_the_battery_is_not_emptied_beyond_its_limit(demand_w, soc, p):
    seen = Observation(0, soc, 50.0, False, demand_w, 10.0)
    command = SAFETY.admissible(Command(False, p), seen)
    after, flows = PLANT.step(PlantState(soc, 50.0), command, demand_w, 10.0)
    assert after.soc >= 0.4
    # and what it holds above the limit is given: the engine adds no more than is missing
    if not p and command.engine_on and flows.p_bat_w < 26e3:
        assert after.soc <= 0.4 + 2e-5


@given(demand_w=st.floats(-20e3, 20e3), speed_mps=st.floats(0.0, 35.0))
def test_the_coolant_is_kept_above_its_lower_limit(demand_w, speed_mps):
    state = PlantState(0.6, 40.1)
    for _ in range(30):
        seen = Observation(0, state.soc, state.t_cl_degc, state.engine_on, demand_w, speed_mps)
        command = SAFETY.admissible(Command(False, 0.0), seen)
        state, _ = PLANT.step(state, command, demand_w, speed_mps)
    high = demand_w + 400.0 + 25e3
    if high > 4e3:  # braking at the charge limit leaves no room for the engine
        assert state.t_cl_degc >= 40.0


@given(p=st.floats(0.0, 71e3), t_cl_degc=st.floats(89.0, 90.0))
def test_the_coolant_is_kept_below_its_upper_limit(p, t_cl_degc):
    # 20 kW at 30 m/s: the battery can stand in for the engine.
    seen = Observation(0, 0.6, t_cl_degc, True, 20e3, 30.0)
    command = SAFETY.admissible(Command(True, p), seen)
    after, _ = PLANT.step(PlantState(0.6, t_cl_degc, True), command, 20e3, 30.0)
    assert after.t_cl_degc <= 90.0


def test_an_admissible_wish_is_granted():
    seen = Observation(0, 0.6, 60.0, True, 10e3, 15.0)
    assert SAFETY.admissible(Command(True, 12e3), seen) == Command(True, 12e3)
    assert SAFETY.admissible(Command(False, 0.0), seen) == Command(False, 0.0)
