"""The loop that drives: one controller, one run; a callback; the same again after a reset."""

import time

import numpy as np
import pytest

from qpmpc import (
    Command,
    Controller,
    Cycle,
    InputError,
    QpmpcError,
    Trip,
    load_cycle,
    simulate,
)
from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.base import Decision
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.registry import make_controller
from qpmpc.results import Run
from qpmpc.trip import Observation
from qpmpc.vehicle import PlantState

NYCC = load_cycle("nycc")
SHORT = Cycle.from_samples("short", np.arange(91), NYCC.speed_mps[60:151])
COARSE = {"dp.soc_step": 0.01, "dp.t_cl_step_k": 2.0, "dp.power_step_w": 2000.0}


class Half(Controller):
    """Half of the demand by the engine, and a memory that depart must clear."""

    name = "half"

    def depart(self, progress=None) -> None:
        self.seen = []

    def step(self, seen: Observation) -> Command:
        self.seen.append(seen)
        return Command(seen.demand_w > 4e3, 0.5 * seen.demand_w)


def assert_same_bits(one: Run, other: Run) -> None:
    for name in ("soc", "t_cl_degc", "engine_on", "p_eng_w", "fuel_g", "iterations", "on_share"):
        np.testing.assert_array_equal(
            getattr(one.trajectory, name), getattr(other.trajectory, name), err_msg=name
        )
    assert one.trajectory.fallback == other.trajectory.fallback


def test_on_step_sees_every_observation_and_decision_in_order() -> None:
    trip, kept = Trip(SHORT), []
    run = drive(trip, Half(trip), on_step=lambda *step: kept.append(step))
    tr = run.trajectory
    assert [seen.step for seen, _ in kept] == list(range(trip.steps))
    for t, (seen, decision) in enumerate(kept):
        assert isinstance(decision, Decision)
        assert (seen.soc, seen.t_cl_degc) == (tr.soc[t], tr.t_cl_degc[t])
        assert decision.command.engine_on == tr.engine_on[t]
        assert decision.command.p_eng_w == pytest.approx(tr.p_eng_w[t])


def test_on_step_changes_nothing_and_its_time_is_not_counted() -> None:
    trip = Trip(Cycle.from_samples("start", np.arange(21), NYCC.speed_mps[60:81]))
    plain = drive(trip, Half(trip))
    watched = drive(trip, Half(trip), on_step=lambda *_: time.sleep(0.05))
    assert_same_bits(plain, watched)
    assert np.median(watched.trajectory.step_time_s) < 0.01


def test_progress_counts_the_steps() -> None:
    trip, seen = Trip(SHORT), []
    drive(trip, Half(trip), progress=lambda *done: seen.append(done))
    assert seen == [(k, trip.steps) for k in range(1, trip.steps + 1)]


@pytest.mark.parametrize("command", [Command(True, -1e9), Command(True, 1e9)])
def test_what_a_step_returns_is_made_admissible(command: Command) -> None:
    class Wild(Half):
        def step(self, seen: Observation) -> Command:
            return command

    run = simulate(SHORT, Wild)
    assert run.controller == "half"
    assert not any(run.summary()["violations"].values())


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (None, "step returned None at 0 s, where a Command or a Decision is needed"),
        ((True, 5e3), r"step returned \(True, 5000.0\)"),
        (Command(True, float("nan")), "p_eng_w=nan at 0 s, where a bool and a finite number"),
        (Command(5e3, True), "engine_on=5000.0"),
        (Command("on", "high"), "engine_on='on'"),
        (Decision(None), "where a Command or a Decision is needed"),
    ],
)
def test_what_is_no_command_is_one_line(made: object, said: str) -> None:
    class Broken(Half):
        def step(self, seen: Observation) -> Command:
            return made

    with pytest.raises(QpmpcError, match=f"half: .*{said}") as refusal:
        simulate(SHORT, Broken)
    assert "\n" not in str(refusal.value)


def test_a_class_without_a_name_has_that_of_the_class() -> None:
    class EagerDriver(Controller):
        def step(self, seen: Observation) -> Command:
            return Command(False, 0.0)

    class Renamed(EagerDriver):
        name = "a/b"

    assert simulate(SHORT, EagerDriver).controller == "eager-driver"
    with pytest.raises(InputError, match="name 'a/b' must have 1 to 64 letters"):
        simulate(SHORT, Renamed)


def test_a_controller_drives_once_until_it_is_reset() -> None:
    trip = Trip(SHORT)
    controller = Half(trip)
    first = drive(trip, controller)
    with pytest.raises(QpmpcError, match=r"'half' has driven already: call reset\(\)") as refusal:
        drive(trip, controller)
    assert "\n" not in str(refusal.value)
    controller.reset()
    assert_same_bits(first, drive(trip, controller))
    assert len(controller.seen) == trip.steps


@pytest.mark.parametrize(
    "other", [Trip("nycc"), Trip(SHORT, "prius-liion"), Trip(SHORT, forecast=NYCC)]
)
@pytest.mark.parametrize("name", ["own", "mh-qp"])
def test_a_controller_drives_no_other_trip(name: str, other: Trip) -> None:
    trip = Trip(SHORT)
    controller = Half(trip) if name == "own" else make_controller(name, trip)
    with pytest.raises(QpmpcError, match=r"was made for .* and cannot drive") as refusal:
        drive(other, controller)
    assert "short" in str(refusal.value)
    assert "\n" not in str(refusal.value)
    drive(Trip(SHORT), controller)  # equal number by number is the same


@pytest.mark.parametrize("keeps", [(), ("trip",), ("trip", "settings")])
def test_an_init_that_forgot_its_base_says_so(keeps: tuple[str, ...]) -> None:
    class Forgetful(Half):
        def __init__(self, trip: Trip, settings: ControllerSettings | None = None) -> None:
            for name, value in (("trip", trip), ("settings", settings)):
                if name in keeps:
                    setattr(self, name, value)

    trip = Trip(SHORT)
    calls = (
        lambda: simulate(SHORT, Forgetful),
        lambda: drive(trip, Forgetful(trip)),
        lambda: Forgetful(trip).decide(trip.start),
    )
    for call in calls:
        with pytest.raises(QpmpcError, match=r"Forgetful.__init__ must call super\(\).__init__"):
            call()


def settings_of(name: str, implementation: str) -> ControllerSettings:
    chosen: dict[str, object] = dict(COARSE) if name == "dp" else {}
    if implementation:
        chosen["mh_qp.implementation"] = implementation
    return ControllerSettings().with_settings(chosen)


@pytest.mark.parametrize(
    ("name", "implementation"),
    [
        ("rule-based", ""),
        ("ecms", ""),
        ("mh-qp", "c"),
        ("mh-qp", "python"),
        ("mh-qp-paper", ""),
        ("baseline-mpc", ""),
        ("dp", ""),
    ],
)
def test_after_reset_the_run_is_the_same_bit_for_bit(
    name: str, implementation: str, monkeypatch, tmp_path
) -> None:
    if implementation == "c" and compiler() is None:
        pytest.skip("no C compiler on this machine")
    if name == "dp":
        pytest.importorskip("numba", reason="not installed: numba, for dynamic programming")
        monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    trip, settings = Trip(SHORT), settings_of(name, implementation)
    controller = make_controller(name, trip, settings)
    runs = [drive(trip, controller)]
    for _ in range(2):
        controller.reset()
        runs.append(drive(trip, controller))
    controller.reset()
    for k in range(20):  # a run left half way, off the trip's own states
        controller.decide(trip.observation(k, PlantState(0.5, 45.0)))
    controller.reset()
    runs.append(drive(trip, controller))
    runs.append(drive(trip, make_controller(name, trip, settings)))
    assert runs[0].fuel_g > 0.0
    for other in runs[1:]:
        assert_same_bits(runs[0], other)
