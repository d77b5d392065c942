"""What the monitor knows of the engine without measuring it."""

import math

import pytest
from plain import plain_car

from qpmpc.controllers.monitor import Flag, InputMonitor
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState
from qpmpc.vehicle.plant import LONG_AGO_S

CAR = plain_car().with_settings(
    {"engine.start_energy_j": 13.5e3, "engine.start_fuel_g": 5.0, "engine.ramp_w_per_s": 9.5e3}
)
MOST_W = CAR.engine.power_max_w


def seen_at(step: int, engine_on: bool) -> Observation:
    return Observation(step, 0.6, 60.0, engine_on, 5e3, 10.0)


class Told:
    """A monitor that is told one second after the other, and what it knows of the engine."""

    def __init__(self) -> None:
        self.monitor = InputMonitor(Plant(CAR))

    def __call__(self, step: int, engine_on: bool, command: Command) -> tuple[int, float]:
        seen, _ = self.monitor.checked(seen_at(step, engine_on))
        self.monitor.commanded(command)
        return seen.engine_for_s, seen.p_eng_before_w


OFF, ON = Command(False, 0.0), Command(True, 8e3)


def test_it_counts_from_starts_and_stops_and_remembers_its_command() -> None:
    told = Told()
    assert told(0, False, ON) == (LONG_AGO_S, 0.0)
    assert told(1, True, Command(True, 9e3)) == (1, 8e3)
    assert told(2, True, OFF) == (2, 9e3)
    assert told(3, False, OFF) == (1, 0.0)
    assert told(4, False, OFF) == (2, 0.0)


def test_missed_seconds_count_and_the_same_second_again_does_not() -> None:
    told = Told()
    told(0, False, ON)
    told(1, True, Command(True, 9e3))
    assert told(6, True, Command(True, 15e3)) == (6, 9e3)  # five seconds with that command
    assert told(6, True, Command(True, 16e3)) == (6, 9e3)  # 15 kW never came
    assert told(7, True, ON) == (7, 16e3)


def test_a_start_within_missed_seconds_was_with_the_last_command() -> None:
    told = Told()
    told(0, False, ON)
    assert told(5, True, ON) == (5, 8e3)


def test_after_a_reset_and_without_a_command_nothing_is_known() -> None:
    told = Told()
    told(0, False, ON)
    told(1, True, ON)
    told.monitor.forget()
    assert told(2, True, OFF) == (LONG_AGO_S, MOST_W)
    assert told(3, True, OFF) == (LONG_AGO_S, MOST_W)  # still on, against its command
    assert told(4, False, OFF) == (1, 0.0)


def test_the_expected_state_after_a_start_counts_cranking_and_its_fuel() -> None:
    plant = Plant(CAR)
    monitor = InputMonitor(plant)
    state = PlantState(0.6, 60.0)
    seen, _ = monitor.checked(seen_at(0, False))
    monitor.commanded(ON)
    after, flows = plant.step(state, ON, seen.demand_w, seen.speed_mps)
    assert flows.cranking_w == 13.5e3
    # a measurement that is none: the prediction takes its place
    used, flags = monitor.checked(seen_at(1, True)._replace(soc=math.nan, t_cl_degc=math.nan))
    assert flags == Flag.BAD_MEASUREMENT
    assert used.soc == pytest.approx(after.soc, abs=1e-12)
    assert used.t_cl_degc == pytest.approx(after.t_cl_degc, abs=1e-9)
