"""Statistics of the long horizon in C from a forecast against those of Python, second by second."""

import ctypes
import math

import numpy as np
import pytest
from forecast_inputs import ForecastInputs

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import GeneratedController, InputBuilder
from qpmpc.codegen.host_library import HostLibrary, build_host_library
from qpmpc.codegen.values import values_of
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.errors import InputError
from qpmpc.preview import StageBuilder, Trace
from qpmpc.preview.forecast_errors import MODELS, forecast
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import load_vehicle

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")

CAR = load_vehicle()
SETTINGS = ControllerSettings()
TWO_HOURS_S = 7200

POWERS = (
    *("demand_w", "short_demand_w", "long_net_w", "long_internal_off_w"),
    *("long_free_net_w", "long_free_internal_off_w"),
)
SHARES = ("long_must_share",)
SPEEDS = ("speed_mps", "short_speed_mps", "long_speed_mps")
SWINGS = ("long_fall_j", "long_rise_j", "short_rise_j")
# f64: Python takes differences of a running sum over the whole trip, 1e8 at most, whose last digit
# is 1e-8; C does not. f32: two units in the last place of 60 kW (0.004 W) and of 40 m/s (4e-6 m/s);
# a swing adds up the 500 s of a block at most.
TOLERANCE = {"f64": (1e-9, 1e-6, 1e-9, 1e-6), "f32": (0.0, 0.01, 1e-5, 1.0)}  # rel., W, m/s, J


def library_of(precision: str, settings: ControllerSettings = SETTINGS, blocks=None, vehicle=CAR):
    return build_host_library(
        values_of(vehicle, settings.mh_qp, settings.rule_based, blocks), precision
    )


@pytest.fixture(scope="module", params=["f64", "f32"])
def library(request) -> HostLibrary:
    return library_of(request.param)


def rounded(trace: Trace, precision: str) -> Trace:
    """What the C code is given: which class a second belongs to must not hang on its last digit."""
    kind = np.float32 if precision == "f32" else np.float64
    return Trace(*(x.astype(kind).astype(float) for x in (trace.demand_w, trace.speed_mps)))


def observed(trace: Trace, step: int) -> Observation:
    return Observation(
        step, 0.6, 50.0, False, float(trace.demand_w[step]), float(trace.speed_mps[step])
    )


def numbers(inputs: object, names: tuple[str, ...]) -> np.ndarray:
    return np.concatenate([np.ravel(np.array(getattr(inputs, n), dtype=float)) for n in names])


def assert_same_inputs(
    library: HostLibrary,
    truth: Trace,
    said: Trace | None = None,
    settings=SETTINGS,
    steps=None,
    vehicle=CAR,
) -> None:
    """Fill in the input of every second (or of those named) in Python and in C."""
    truth = rounded(truth, library.precision)
    said = None if said is None else rounded(said, library.precision)
    preview = StageBuilder(vehicle, truth, said or truth, settings.mh_qp.horizon)
    python, ours = InputBuilder(preview.preview), ForecastInputs(library, truth, said)
    want, have = library.input_type(), library.input_type()
    relative, power_w, speed_mps, energy_j = TOLERANCE[library.precision]
    for step in range(truth.steps) if steps is None else steps:
        ctypes.memset(ctypes.byref(have), 0xFF, ctypes.sizeof(have))  # everything is written
        python.fill(observed(truth, step), want)
        ours.fill(observed(truth, step), have)
        assert have.short_count == want.short_count
        assert list(have.long_duration_s) == list(want.long_duration_s)
        assert list(have.long_rises) == list(want.long_rises)
        for names, absolute in (
            (POWERS, power_w),
            (SPEEDS, speed_mps),
            (SWINGS, energy_j),
            (SHARES, 1e-6),
        ):
            np.testing.assert_allclose(
                numbers(have, names), numbers(want, names), rtol=relative, atol=absolute
            )


def cut(name: str, steps: int) -> Trace:
    whole = Trace.of(load_cycle(name), CAR)
    return Trace(whole.demand_w[:steps], whole.speed_mps[:steps])


@pytest.mark.parametrize("name", cycle_names())
def test_every_second_of_every_cycle_equals_python(library, name) -> None:
    assert_same_inputs(library, Trace.of(load_cycle(name), CAR))


def test_a_weak_battery_and_its_seconds_without_a_choice_equal_python() -> None:
    car = load_vehicle()
    trip = Trace.of(load_cycle("udds"), car)
    for precision in ("f64", "f32"):
        assert_same_inputs(library_of(precision, vehicle=car), trip, vehicle=car)


def test_a_trip_of_two_hours_loses_no_digits(library) -> None:
    """4 x WLTC 3b: single precision as good in the last second of a block as in its first."""
    whole = Trace.of(load_cycle("wltc-3b"), CAR)
    trip = Trace(np.tile(whole.demand_w, 4), np.tile(whole.speed_mps, 4))
    assert trip.steps == TWO_HOURS_S
    assert_same_inputs(library, trip)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ["nycc", "nedc-truncated"])
def test_wrong_forecasts_equal_python(library, model, name) -> None:
    """Shorter and longer than the truth among them."""
    cycle = load_cycle(name)
    for seed in (1, 2):
        assert_same_inputs(library, Trace.of(cycle, CAR), forecast(cycle, CAR, model, seed))


@pytest.mark.parametrize("said_steps", [60, 598])
@pytest.mark.parametrize("true_steps", [60, 598])
def test_arrival_and_a_forecast_of_another_length(library, said_steps, true_steps) -> None:
    assert_same_inputs(library, cut("nycc", true_steps), cut("udds", said_steps))


@pytest.mark.parametrize("steps", [1, 2, 6, 7, 8, 19, 20, 21, 22, 41])
def test_short_trips_equal_python(library, steps) -> None:
    """Shorter than the blocks are many, than the short horizon, and just longer."""
    assert_same_inputs(library, cut("hwfet", steps))


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    [
        {"mh_qp.horizon.classes": 1, "mh_qp.horizon.short_stages": 12},
        {"mh_qp.horizon.blocks": 0, "mh_qp.horizon.block_s": 100},
        {"mh_qp.horizon.class_hard_w": 3000.0, "mh_qp.horizon.class_braking_w": -4000.0},
        {"mh_qp.horizon.blocks": 1, "mh_qp.horizon.short_stages": 1},
        {"mh_qp.horizon.blocks": 40},
    ],
)
def test_other_horizons_equal_python(overrides) -> None:
    settings, trip = SETTINGS.with_settings(overrides), Trace.of(load_cycle("nycc"), CAR)
    blocks = settings.mh_qp.horizon.block_count(trip.steps)
    for precision in ("f64", "f32"):
        assert_same_inputs(library_of(precision, settings, blocks), trip, settings=settings)


def test_seconds_left_out_repeated_and_gone_back_to_equal_python(library) -> None:
    steps = [0, 0, 3, 4, 100, 100, 99, 350, 10, 590, 597, 597, 20]
    assert_same_inputs(library, Trace.of(load_cycle("nycc"), CAR), steps=steps)


def test_with_blocks_of_fixed_length_what_lies_beyond_the_last_is_left_out() -> None:
    settings = SETTINGS.with_settings({"mh_qp.horizon.blocks": 0, "mh_qp.horizon.block_s": 50})
    library, trip = library_of("f64", settings, blocks=4), Trace.of(load_cycle("nycc"), CAR)
    into = library.input_type()
    ForecastInputs(library, trip).fill(observed(trip, 0), into)
    assert sum(into.long_duration_s) == 4 * 50 - SETTINGS.mh_qp.horizon.short_stages


# --- what is no forecast -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("demand_w", "speed_mps"),
    [(math.nan, 10.0), (math.inf, 10.0), (2e6, 10.0), (5e3, math.nan), (5e3, -1.0), (5e3, 200.0)],
)
def test_a_value_that_a_step_would_refuse_is_refused_before_the_trip(
    library, demand_w, speed_mps
) -> None:
    trip = cut("nycc", 100)
    bad = Trace(trip.demand_w.copy(), trip.speed_mps.copy())
    bad.demand_w[70], bad.speed_mps[70] = demand_w, speed_mps
    with pytest.raises(InputError, match="refuses the forecast"):
        ForecastInputs(library, trip, bad)


@pytest.mark.parametrize("steps", [0, 100_001])
def test_no_trip_and_one_too_long_are_refused(library, steps) -> None:
    with pytest.raises(InputError, match="refuses the forecast"):
        ForecastInputs(library, Trace(np.zeros(steps), np.zeros(steps)))


def test_after_a_refusal_the_short_horizon_drives_alone(library) -> None:
    functions, into = library.functions, library.input_type()
    memory = ctypes.create_string_buffer(functions.mpc_forecast_bytes())
    trip = cut("nycc", 100)
    good = ForecastInputs(library, trip)
    nothing = ForecastInputs(library, trip)._trip.after(100)
    assert functions.mpc_forecast_start(memory, ctypes.byref(nothing)) == -1
    assert functions.mpc_in_from_forecast(memory, 0, ctypes.byref(into)) == -1
    assert into.short_count == 0
    ahead = ctypes.byref(good._trip.after(5))
    assert functions.mpc_in_from_preview(memory, 5, 25, ahead, ctypes.byref(into)) == 0
    assert into.short_count == SETTINGS.mh_qp.horizon.short_stages
    assert not any(into.long_duration_s)


@pytest.mark.parametrize("step", [-1, -(2**31), 100, 101, 2**31 - 1])
def test_a_second_outside_the_trip_has_no_preview_and_a_step_says_so(library, step) -> None:
    trip = cut("nycc", 100)
    inputs, into = ForecastInputs(library, trip), library.input_type()
    inputs.fill(observed(trip, 40), into)
    assert inputs._from_forecast(inputs._memory, step, ctypes.byref(into)) == -1
    state, out = ctypes.create_string_buffer(library.state_bytes), library.output_type()
    library.init(state)
    flags = library.step(state, ctypes.byref(into), ctypes.byref(out))
    assert flags == 2  # bad preview
    inputs.fill(observed(trip, 41), into)
    flags = Flag(library.step(state, ctypes.byref(into), ctypes.byref(out)))
    assert flags & ~Flag.BAD_CLOCK == Flag.WARMING_UP  # the clock, too, has come from far away


# --- closed loop ---------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [False, True])
def test_a_trip_driven_with_either_statistics_is_one_trip(library, wrong) -> None:
    """f64: the same commands. f32: statistics a digit apart, so commands on the flat optimum may
    differ and the engine's switching must not; fuel to 0.01 %."""
    trip = Trip("nycc", CAR)
    if wrong:
        trip = trip.with_forecast(forecast(trip.cycle, CAR, "combined", 3))
    python, ours = (GeneratedController(trip, precision=library.precision) for _ in range(2))
    ours.inputs = ForecastInputs(ours.library, trip.truth, trip.forecast if wrong else None)
    want, have = (drive(trip, controller) for controller in (python, ours))
    np.testing.assert_array_equal(have.trajectory.engine_on, want.trajectory.engine_on)
    assert have.summary()["fallback_steps"] == 0
    if library.precision == "f64":
        np.testing.assert_allclose(have.trajectory.p_eng_w, want.trajectory.p_eng_w, atol=1e-3)
    assert have.fuel_soc_balanced_g == pytest.approx(want.fuel_soc_balanced_g, rel=1e-4)


# --- demand --------------------------------------------------------------------------------------


# Parts of the force, inertia and slope, may cancel: round-off counts in the largest part. The last
# car has the road load of the cold, and friction brakes at low speed.
@pytest.mark.parametrize(("precision", "digits"), [("f64", 1e-15), ("f32", 1e-6)])
@pytest.mark.parametrize("vehicle", ["prius-nimh", "prius-liion", "paper-nimh"])
def test_demand_of_speed_acceleration_and_grade_equals_python(vehicle, precision, digits) -> None:
    car, flat = load_vehicle(vehicle), load_cycle("wltc-3b")
    grade = np.random.default_rng(1).uniform(-0.1, 0.1, len(flat.time_s))
    hills = Cycle("hills", flat.time_s, flat.speed_mps, grade)
    library = library_of(precision, vehicle=car)
    function = library.functions.mpc_demand_w
    function.argtypes, function.restype = [library.real] * 3, library.real
    road = np.stack([hills.step_speed_mps, hills.step_accel_mps2, hills.step_grade])
    have = [function(*second) for second in road.T.tolist()]
    parts = np.abs(road[0]) * car.chassis.mass_kg * (1.0 + np.abs(road[1]) + 10 * np.abs(road[2]))
    error = np.abs(have - Trace.of(hills, car).demand_w)
    assert (error <= 4 * digits * parts).all()
