"""Learning in closed loop: what it wins back, and what a wrong measurement may do."""

from dataclasses import replace

import pytest

from qpmpc.closed_loop import drive
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.faults.models import as_faults
from qpmpc.simulation import simulate
from qpmpc.trip import Trip

NYCC = load_cycle("nycc")
SHORT = replace(
    NYCC, time_s=NYCC.time_s[:181], speed_mps=NYCC.speed_mps[:181], grade=NYCC.grade[:181]
)


def fuel_g(learning: bool, late_s: int = 0, cycle: Cycle = NYCC, **settings: object) -> float:
    chosen = {f"model.{name}": value for name, value in settings.items()}
    trip = Trip(cycle).with_settings(chosen)
    fault = {"kind": "delay", "signal": "fuel_g", "at_s": 0, "for_s": trip.steps}
    late = as_faults([{**fault, "value": float(late_s)}]) if late_s else None
    run = drive(trip, MhQp(trip.as_believed, {"mh_qp.learning": learning}), faults=late)
    assert not any(run.summary()["violations"].values())
    assert not run.trajectory.flags.any()
    return run.fuel_soc_balanced_g


@pytest.mark.slow
def test_learning_wins_back_half_of_what_a_tilted_map_costs() -> None:
    """Measured: 70 % of 4.3 g.

    On one cycle it hangs on single starts: on NYCC a third, where the map is not yet known as the
    longest run begins, on UDDS 80 %.
    """
    lost_g = left_g = 0.0
    for cycle in map(load_cycle, ("nycc", "udds", "nedc-truncated")):
        right, wrong = fuel_g(False, cycle=cycle), fuel_g(False, cycle=cycle, fuel_tilt=-0.1)
        learned = fuel_g(True, cycle=cycle, fuel_tilt=-0.1)
        assert wrong > 1.002 * right
        assert learned < wrong
        lost_g, left_g = lost_g + wrong - right, left_g + learned - right
    assert left_g < 0.5 * lost_g


def test_learning_costs_nothing_where_the_map_is_right() -> None:
    """Chords at other breakpoints: another curve within the fit's tolerance, so not the same."""
    assert fuel_g(True) == pytest.approx(fuel_g(False), rel=1e-3)


@pytest.mark.parametrize("late_s", [1, 2])
def test_a_late_meter_costs_nothing_where_the_map_is_right(late_s: int) -> None:
    """Samples of single seconds made it 1.1 to 2.4 % with a second's delay."""
    assert fuel_g(True, late_s) == pytest.approx(fuel_g(False), rel=2e-3)


@pytest.mark.slow
def test_a_late_meter_wins_back_much_of_what_a_tilted_map_costs() -> None:
    """Measured: 0.46 of 0.97 %; what is late has to be known before a tilt is."""
    right, wrong = fuel_g(False), fuel_g(False, fuel_tilt=-0.1)
    assert fuel_g(True, 1, fuel_tilt=-0.1) - right < 0.6 * (wrong - right)


def test_without_learning_the_fuel_injected_is_not_read() -> None:
    trip = Trip(NYCC)
    one, other = MhQp(trip), MhQp(trip)
    state = trip.plant.initial_state()
    for second in range(120):
        seen = trip.observation(second, state)
        decision = one.decide(seen)
        blind = other.decide(seen._replace(fuel_g=float("nan")))
        assert (decision.command, decision.flags) == (blind.command, blind.flags)
        state, _ = trip.plant.step(state, decision.command, seen.demand_w, seen.speed_mps)


def test_a_meter_that_fails_is_flagged_and_leaves_the_map() -> None:
    trip = Trip(SHORT).with_settings({"model.fuel_tilt": -0.1})
    controller = MhQp(trip.as_believed, {"mh_qp.learning": True})
    fault = {"kind": "nan", "signal": "fuel_g", "at_s": 0, "for_s": trip.steps}
    run = drive(trip, controller, faults=as_faults([fault]))
    assert run.summary()["flags"] == {"bad measurement": trip.steps}
    assert not any(run.summary()["violations"].values())
    assert run.trajectory.engine_on.any()
    learned = controller.planner.learned_fuel
    assert learned is not None
    assert learned.idle_and_slope == (0.0, 0.0)


def test_a_fault_of_a_meter_that_nobody_reads_is_said_to_be_idle() -> None:
    fault = {"kind": "nan", "signal": "fuel_g", "at_s": 10, "for_s": 5}
    run = simulate(SHORT, "mh-qp", faults=[fault])
    assert any("does not read the fuel injected" in remark for remark in run.remarks)


def test_a_restart_forgets_what_was_learned() -> None:
    trip = Trip(NYCC).with_settings({"model.fuel_tilt": -0.1}).as_believed
    controller = MhQp(trip, {"mh_qp.learning": True})
    learned = controller.planner.learned_fuel
    assert learned is not None
    learned.take(1.0, 15e3, 90.0, True, False)
    assert learned.idle_and_slope != (0.0, 0.0)
    controller.forget()
    assert learned.idle_and_slope == (0.0, 0.0)
