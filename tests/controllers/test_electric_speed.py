"""The highest speed of electric driving: above it the engine runs, whatever a controller wants."""

from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plain import plain_car

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.values import values_of
from qpmpc.controllers.base import Controller
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.results import Run
from qpmpc.simulation import simulate
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import Command, Plant, Vehicle
from qpmpc.vehicle.must_run import must_run, too_fast
from qpmpc.verification.dynamic_programming.power_limits import power_limits
from qpmpc.verification.nonlinear.problem import NlpProblem, NlpVar

LIMIT_MPS = 25.0
FREE = plain_car()
CAR = FREE.with_settings({"engine.electric_max_mps": LIMIT_MPS})
SETTINGS = ControllerSettings()
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


def drawn(name: str, time_s: list[float], speed_mps: list[float], grade: float = 0.0) -> Cycle:
    """A road that is level for 28 s, to gather speed on."""
    seconds = np.arange(time_s[-1] + 1.0)
    slope = np.where(seconds < 28.0, 0.0, grade)
    return Cycle.from_samples(name, seconds, np.interp(seconds, time_s, speed_mps), slope)


MOTORWAY = drawn(
    "motorway",
    [0, 18, 30, 40, 50, 60, 65, 76, 84, 87, 105],
    [0, 18, 24, 28, 24.5, 26, 24.7, 30, 30, 24, 0],
)
# downhill, 4 s above the limit, 4 s below it: each time the plan would like to stop the engine
SWINGING = drawn(
    "swinging", [0, 25, *range(30, 70, 4), 85], [0, 24.8, *([25.3, 24.6] * 5), 0], grade=-0.01
)
RESTING = CAR.with_settings({"engine.min_off_s": 5})


@cache
def run_of(name: str, implementation: str = "", car: Vehicle = CAR, road: Cycle = MOTORWAY) -> Run:
    settings: dict[str, object] = {"dp.grid": "quick"} if name == "dp" else {}
    if name == "mh-qp":
        settings = {"mh_qp.implementation": implementation}
    return simulate(road, name, car, settings=settings)


CONTROLLERS = [
    ("rule-based", ""),
    ("ecms", ""),
    ("mh-qp", "python"),
    pytest.param("mh-qp", "c", marks=needs_compiler),
    ("mh-costate", ""),
    ("dp", ""),
]


@pytest.mark.parametrize(("name", "implementation"), CONTROLLERS)
def test_no_second_above_the_limit_is_driven_with_the_engine_off(name, implementation):
    run = run_of(name, implementation)
    fast = run.trajectory.speed_mps > LIMIT_MPS
    assert fast.sum() > 40
    assert not run_of("dp", car=FREE).trajectory.engine_on[fast].all()  # it would be
    assert run.trajectory.engine_on[fast].all()
    assert run.excess.off_mps.max() == 0.0
    assert not any(run.summary()["violations"].values())
    assert run.summary()["fallback_steps"] == 0
    rise_w = np.diff(run.trajectory.p_eng_w, prepend=0.0)
    assert rise_w.max() <= CAR.engine.ramp_w_per_s


def test_the_limit_costs_fuel():
    limited, free = run_of("dp"), run_of("dp", car=FREE)
    # the grids' own error is some 0.1 % of the fuel
    assert limited.fuel_soc_balanced_g > 1.01 * free.fuel_soc_balanced_g


@pytest.mark.parametrize(("name", "implementation"), CONTROLLERS[2:5])
def test_plans_come_near_the_optimum(name, implementation):
    optimum_g = run_of("dp").fuel_soc_balanced_g
    assert run_of(name, implementation).fuel_soc_balanced_g < 1.01 * optimum_g


@needs_compiler
@pytest.mark.parametrize(("road", "car"), [(MOTORWAY, CAR), (SWINGING, RESTING)])
def test_generated_c_commands_the_same_as_python(road, car):
    trip = Trip(road, car)
    mine, its = GeneratedController(trip), MhQp(trip)
    mine.begin(trip)
    its.begin(trip)
    state = trip.plant.initial_state()
    for second in range(trip.steps):
        seen = trip.observation(second, state)
        ours, python = mine.decide(seen), its.decide(seen)
        assert ours.command.engine_on == python.command.engine_on
        # as for other cars, see tests/codegen/test_host_library.py
        assert ours.command.p_eng_w == pytest.approx(python.command.p_eng_w, abs=1e-2)
        assert (ours.fallback, ours.flags) == (python.fallback, python.flags)
        state, _ = trip.plant.step(state, python.command, seen.demand_w, seen.speed_mps)


@needs_compiler
@pytest.mark.parametrize(("road", "car"), [(MOTORWAY, CAR), (SWINGING, RESTING)])
def test_single_precision_does_too(road, car):
    """On in the same seconds above the limit, at powers that differ as always; fuel counts."""
    single = drive(Trip(road, car), GeneratedController(Trip(road, car), precision="f32"))
    assert single.excess.off_mps.max() == 0.0
    double = run_of("mh-qp", "c", car, road)
    assert single.fuel_soc_balanced_g == pytest.approx(double.fuel_soc_balanced_g, rel=2e-3)


@given(st.floats(0.0, 250.0), st.integers(2, 7), st.integers(-3, 3))
def test_speed_and_limit_compare_alike_in_single_precision(limit_kmh, digits, hundredths_kmh):
    """A limit typed with some digits, and a cruise at it or beside it, as of any file in km/h."""
    limit_mps = min(round(limit_kmh / 3.6, digits), 70.0)
    speed_mps = max(round(limit_kmh, 2) + 0.01 * hundredths_kmh, 0.0) / 3.6
    car = FREE.with_settings({"engine.electric_max_mps": limit_mps})
    in_c = values_of(car, SETTINGS.mh_qp, SETTINGS.rule_based).scalars["electric_max_mps"]
    above = bool(np.float32(speed_mps) > np.float32(in_c))
    # apart from a speed that is beyond the limit by the rounding itself, to its own last digit
    assume(abs(speed_mps - in_c) > 4e-6)
    assert above == too_fast(car, speed_mps) == (speed_mps - limit_mps > 1e-5)


@pytest.mark.parametrize(("name", "implementation"), CONTROLLERS[2:])
def test_a_drive_across_the_limit_and_back_keeps_shortest_runs_and_rests(name, implementation):
    """Where there is a preview: the rest would take longer than the car is slow."""
    run = run_of(name, implementation, RESTING, SWINGING)
    assert run.excess.off_mps.max() == 0.0
    fast = (run.trajectory.speed_mps > LIMIT_MPS).astype(int)
    assert np.count_nonzero(np.diff(fast)) >= 10
    change = np.diff(run.trajectory.engine_on.astype(int), prepend=0)
    starts, stops = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    assert len(stops) > 0
    assert (stops - starts[: len(stops)]).min() >= RESTING.engine.min_on_s
    rests = starts[1:] - stops[: len(starts) - 1]
    assert rests.min(initial=100) >= RESTING.engine.min_off_s


@pytest.mark.parametrize("name", ["rule-based", "ecms"])
def test_without_a_preview_a_rest_yields_to_the_limit_alone(name):
    run = run_of(name, "", RESTING, SWINGING)
    tr = run.trajectory
    assert run.excess.off_mps.max() == 0.0
    change = np.diff(tr.engine_on.astype(int), prepend=0)
    starts, stops = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    rests = starts[1:] - stops[: len(starts) - 1]
    cut_short = starts[1:][rests < RESTING.engine.min_off_s]
    assert len(cut_short) > 0
    assert (tr.speed_mps[cut_short] > LIMIT_MPS).all()
    assert (stops - starts[: len(stops)]).min() >= RESTING.engine.min_on_s


class Off(Controller):
    """Wants the engine off in every second."""

    def step(self, seen: Observation) -> Command:
        return Command(False, 0.0)


class OffWhatever(Off):
    """Has it off, too."""

    has_safety_layer = True


def test_a_command_off_is_answered_with_on():
    run = simulate(MOTORWAY, Off, CAR.with_settings({"engine.ramp_w_per_s": 5e3}))
    tr = run.trajectory
    assert tr.engine_on[tr.speed_mps > LIMIT_MPS].all()
    assert np.diff(tr.p_eng_w, prepend=0.0).max() <= 5e3  # a forced start too
    idle_g = tr.fuel_g[tr.engine_on & (tr.p_eng_w == 0.0)]
    assert len(idle_g) > 0
    assert idle_g.min() > 0.1  # idling is not free


def test_an_engine_off_above_the_limit_is_obeyed_counted_and_said():
    run = simulate(MOTORWAY, OffWhatever, CAR)
    assert not run.trajectory.engine_on.any()
    fast = run.trajectory.speed_mps > LIMIT_MPS
    np.testing.assert_array_equal(run.excess.off_mps > 0.0, fast)
    assert run.excess.off_mps.max() == run.trajectory.speed_mps.max() - LIMIT_MPS
    (line,) = [line for line in run.not_comparable if "limits are exceeded" in line]
    assert "engine off at 5 m/s more than engine.electric_max_mps" in line


def test_a_trip_says_where_the_engine_has_to_run():
    fast = int((Trip(MOTORWAY, CAR).truth.speed_mps > LIMIT_MPS).sum())
    (line,) = Trip(MOTORWAY, CAR).remarks
    assert line == (
        f"in {fast} of {MOTORWAY.steps} s the car is faster than engine.electric_max_mps, 25 m/s: "
        "the engine must run"
    )
    assert Trip(MOTORWAY, FREE).remarks == ()


@given(
    soc=st.floats(0.35, 0.85),
    t_cl_degc=st.floats(38.0, 95.0),
    engine_on=st.booleans(),
    demand_w=st.floats(-60e3, 60e3),
    for_s=st.integers(1, 5),
    least_w=st.sampled_from([0.0, 2000.0]),
)
def test_full_battery_hot_coolant_and_braking_do_not_stop_it(
    soc, t_cl_degc, engine_on, demand_w, for_s, least_w
):
    car = CAR.with_settings({"engine.power_min_w": least_w})
    layer, plant = SafetyLayer(Plant(car)), Plant(car)
    seen = Observation(0, soc, t_cl_degc, engine_on, demand_w, 30.0, for_s, 0.0)
    command = layer.admissible(Command(False, 0.0), seen)
    assert command.engine_on
    if demand_w < 0.0 and soc >= car.battery.soc_max:
        assert command.p_eng_w <= max(car.battery.aux_power_w, least_w)
    slow = layer.admissible(Command(False, 0.0), seen._replace(speed_mps=20.0))
    if slow.engine_on:  # it has to run anyway: the speed asks for nothing more
        assert slow.p_eng_w == pytest.approx(command.p_eng_w, abs=300.0)
    assert plant.vehicle.engine.electric_max_mps == LIMIT_MPS


def test_the_engine_must_run_for_power_or_for_speed():
    most_w = CAR.battery.power_discharge_max_w
    net_w, speed_mps = np.array([most_w, most_w + 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 25.0, 25.1])
    assert must_run(CAR, net_w, speed_mps).tolist() == [False, True, False, True]
    one_by_one = zip(net_w.tolist(), speed_mps.tolist(), strict=True)
    assert [must_run(CAR, p, v) for p, v in one_by_one] == [False, True, False, True]


def test_dynamic_programming_starts_in_time_for_the_cranking():
    """At the limit of speed 25 kW and 13 kW to crank with: the ramp of 10 kW/s is too slow."""
    slow_ramp = {"engine.start_energy_j": 13e3, "engine.ramp_w_per_s": 10e3}
    car, speed_mps = CAR.with_settings(slow_ramp), np.array([24.0, 24.0, 26.0, 24.0])
    demand_w = np.full(4, 25e3 - CAR.battery.aux_power_w)
    _, _, off_allowed = power_limits(car, demand_w, speed_mps)
    assert off_allowed.tolist() == [True, False, False, True]
    _, _, off_allowed = power_limits(car, demand_w - 5e3, speed_mps)
    assert off_allowed.tolist() == [True, True, False, True]


def test_the_nonlinear_program_has_it_and_room_for_it():
    """In hard braking too, where the battery takes less than the engine's least power."""
    car = CAR.with_settings({"engine.power_min_w": 3e3, "battery.power_charge_max_w": 21e3})
    trip = Trip(MOTORWAY, car)
    horizon = MhQp(trip).planner.of_qp.horizon
    preview = trip.preview(horizon)
    stages = preview.at(75)
    program = NlpProblem(car, preview.count, horizon.short_stages, MhQp(trip).planner.of_qp.qp)
    data = program.data(stages, 0.6, 60.0)
    lower, upper = (
        values[:-1].reshape(-1, program.count)[:, NlpVar.ON] for values in (data.lower, data.upper)
    )
    fast = stages.speed_mps > LIMIT_MPS
    assert fast[: horizon.short_stages].sum() > 10
    assert stages.net_w[fast].min() < -20e3
    assert (lower[fast] > 0.98).all()
    assert (lower <= upper).all()


@pytest.mark.parametrize("name", ["mh-qp", "mh-costate"])
def test_plans_have_room_for_the_least_power_in_hard_braking(name):
    """The battery takes nothing more, the engine must run and has a least power."""
    braking = drawn("braking", [0, 25, 60, 66, 75], [0, 29, 30, 24, 0])
    car = CAR.with_settings({"engine.power_min_w": 4e3, "battery.power_charge_max_w": 5e3})
    settings = {"mh_qp.implementation": "python"} if name == "mh-qp" else {}
    run = simulate(braking, name, car, settings=settings)
    assert run.summary()["fallback_steps"] == 0
    assert run.trajectory.engine_on[run.trajectory.speed_mps > LIMIT_MPS].all()
    assert run.summary()["violations"]["power_w"] == 0.0
