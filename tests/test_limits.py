"""Runs that leave the limits of the car: said in one sentence, and not compared."""

import numpy as np
import pytest
from plain import plain_car

from qpmpc.controllers.base import Controller, Decision
from qpmpc.cycles import Cycle
from qpmpc.simulation import simulate
from qpmpc.vehicle import Command, load_vehicle


def constant(speed_mps: float, grade: float, seconds: int = 200) -> Cycle:
    ramp = np.minimum(np.arange(seconds + 1) * 1.0, speed_mps)
    return Cycle("climb", np.arange(seconds + 1.0), ramp, np.full(seconds + 1, grade))


@pytest.mark.parametrize("controller", ["mh-qp", "rule-based", "ecms"])
def test_a_climb_that_asks_too_much_power_is_beyond_the_car(controller) -> None:
    run = simulate(constant(25.0, 0.25), controller)
    row = run.summary()
    assert not row["comparable"]
    assert row["soc_min"] >= 0.0
    assert row["t_cl_max_degc"] <= 130.0
    (line,) = [line for line in row["remarks"] if "beyond the car" in line]
    first = int(line.split("from ")[1].split()[0])
    asked_w = run.trajectory.demand_w + 400.0
    car = load_vehicle()
    most_w = car.engine.power_max_w + car.battery_discharge_max_w
    assert first == int(np.argmax(asked_w > most_w))
    assert f"demand {(asked_w.max() - most_w) / 1e3:.3g} kW" in line or "SOC" in line


def test_a_climb_that_overheats_the_engine_says_by_how_much() -> None:
    row = simulate(constant(25.0, 0.10, 600), "rule-based", plain_car()).summary()
    (line,) = [line for line in row["remarks"] if "beyond the car" in line]
    assert f"coolant {row['violations']['t_cl_degc']:.2g} K outside 40..90 °C" in line
    assert not row["comparable"]


class Careless(Controller):
    """Runs the engine at full power whatever the limits."""

    has_safety_layer = True

    def step(self, seen: object) -> Command:
        return Command(True, 71e3)


def test_limits_that_a_command_would_have_kept_are_told_from_a_trip_beyond_the_car() -> None:
    row = simulate(constant(15.0, 0.0), Careless).summary()
    assert any("limits are exceeded" in line for line in row["remarks"])
    assert not any("beyond the car" in line for line in row["remarks"])
    assert not row["comparable"]


class Fallen(Controller):
    """Says that a fallback drives."""

    def step(self, seen: object) -> Decision:
        return Decision(Command(False, 0.0), "rule-based")


def test_a_run_mostly_on_fallbacks_is_not_comparable() -> None:
    run = simulate(constant(1.0, 0.0, 40), Fallen)
    assert any(line.startswith("fallbacks drove in 40 of 40 s") for line in run.not_comparable)
    assert not run.comparable


def test_a_run_within_the_limits_says_nothing() -> None:
    run = simulate("nycc", "mh-qp", load_vehicle())
    assert run.not_comparable == []
    assert not run.excess.any.any()


def test_an_engine_may_idle_while_the_brakes_hold_a_full_battery() -> None:
    # 15 min of 6 % downhill: nothing but an idling engine keeps the coolant above its limit
    run = simulate(constant(18.0, -0.06, 900), "mh-qp")
    row = run.summary()
    assert row["soc_max"] == pytest.approx(0.8, abs=1e-3)
    assert row["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
    idles = run.trajectory.engine_on & (run.trajectory.p_friction_w > 0.0)
    assert idles.sum() > 100


def test_a_start_below_the_least_coolant_temperature_says_how_to_ask_for_one() -> None:
    cold = {"trip.t_cl_init_degc": 22.0}
    run = simulate(constant(15.0, 0.0), "rule-based", settings=cold)
    (line,) = [line for line in run.not_comparable if "coolant" in line]
    assert "departs at 22 °C: a cold start asks for a lower thermal.t_cl_min_degc" in line
    lower = cold | {"thermal.t_cl_min_degc": 15.0}
    assert simulate(constant(15.0, 0.0), "rule-based", settings=lower).comparable


def test_a_run_is_printed_in_a_line() -> None:
    run = simulate(constant(15.0, 0.0), "rule-based")
    assert str(run).startswith(f"rule-based on climb: {run.fuel_soc_balanced_g:.1f} g of fuel")
    assert len(repr(run)) < 1000  # no trajectory in it
