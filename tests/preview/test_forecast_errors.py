"""Forecast errors: what each model may change and what not; trips longer and shorter than known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.preview.forecast_errors import (
    MODELS,
    another_day,
    forecast,
    shift,
    speed_noise,
    stop_durations,
    travel_time_stretch,
)
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle

VEHICLE = load_vehicle()
NYCC = load_cycle("nycc")
SEEDS = st.integers(0, 2**32 - 1)

# Trips with stops at will: some seconds of driving at some speed, some seconds of standing.
TRIPS = st.lists(
    st.tuples(st.integers(1, 20), st.floats(0.5, 30.0), st.integers(1, 20)), min_size=1, max_size=8
).map(
    lambda parts: Cycle.from_samples(
        "trip",
        np.arange(1 + sum(drive + stop for drive, _, stop in parts)),
        np.concatenate([[0.0], *(np.r_[np.full(d, v), np.zeros(s)] for d, v, s in parts)]),
    )
)


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS, name=st.sampled_from(list(MODELS)))
def test_every_forecast_is_a_finite_trip_and_repeats_with_its_seed(
    trip: Cycle, seed: int, name: str
) -> None:
    made, again = (forecast(trip, VEHICLE, name, seed) for _ in range(2))
    assert made.steps >= 1
    assert np.isfinite(made.demand_w).all()
    assert (made.speed_mps >= 0.0).all()
    assert np.array_equal(made.demand_w, again.demand_w)


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS)
def test_noise_keeps_stops_and_length(trip: Cycle, seed: int) -> None:
    noisy = speed_noise(trip, np.random.default_rng(seed))
    assert noisy.steps == trip.steps
    assert (noisy.speed_mps[trip.speed_mps == 0.0] == 0.0).all()


def test_noise_has_the_stated_size_and_correlation() -> None:
    steps = 200_000
    steady = Cycle.from_samples("steady", np.arange(steps + 1), np.full(steps + 1, 10.0))
    share = speed_noise(steady, np.random.default_rng(1)).speed_mps / 10.0 - 1.0
    # 20 s in 200,000 s: some 10,000 independent samples, so 1 % of the deviation is one sigma
    assert share.std() == pytest.approx(0.15, rel=0.05)
    lag = 10
    correlation = np.corrcoef(share[:-lag], share[lag:])[0, 1]
    assert correlation == pytest.approx(2.0 * np.exp(-1.0), abs=0.04)
    # a driver's accelerations: derivative v 0.15 / c with c = 10 s
    assert np.diff(share).std() == pytest.approx(0.015, rel=0.1)


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS)
def test_stretch_keeps_the_distance(trip: Cycle, seed: int) -> None:
    stretched = travel_time_stretch(trip, np.random.default_rng(seed))
    assert 0.7 < stretched.steps / max(trip.steps, 1) < 1.4 or trip.steps < 10
    # sampling at whole seconds moves the edges of these square trips by up to a second each
    edges = 2 * np.count_nonzero(np.diff(trip.speed_mps))
    assert abs(stretched.distance_m - trip.distance_m) <= trip.speed_mps.max() * (1 + edges)


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS)
def test_shift_moves_the_trip_as_a_whole(trip: Cycle, seed: int) -> None:
    moved = shift(trip, np.random.default_rng(seed))
    common = min(len(moved.speed_mps), len(trip.speed_mps))
    assert np.array_equal(moved.speed_mps[-common:], trip.speed_mps[-common:])


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS)
def test_wrong_stops_leave_the_driving_as_it_is(trip: Cycle, seed: int) -> None:
    other = stop_durations(trip, np.random.default_rng(seed))
    driven, known = other.speed_mps[other.speed_mps > 0], trip.speed_mps[trip.speed_mps > 0]
    assert np.array_equal(driven, known)
    stops = [np.count_nonzero(np.diff((c.speed_mps == 0).astype(int)) == 1) for c in (other, trip)]
    assert stops[0] == stops[1]


@settings(max_examples=40, deadline=None)
@given(trip=TRIPS, seed=SEEDS)
def test_another_day_has_the_same_seconds_in_another_order(trip: Cycle, seed: int) -> None:
    other = another_day(trip, np.random.default_rng(seed))
    assert np.array_equal(np.sort(other.speed_mps), np.sort(trip.speed_mps))


def test_models_do_change_a_real_trip_and_seeds_differ() -> None:
    truth = Trace.of(NYCC, VEHICLE)
    for name in MODELS:
        made, other = (forecast(NYCC, VEHICLE, name, seed) for seed in (1, 2))
        assert not np.array_equal(made.demand_w, truth.demand_w), name
        assert not np.array_equal(made.demand_w, other.demand_w), name


def test_an_unknown_model_is_named_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"'weather'.*speed noise"):
        forecast(NYCC, VEHICLE, "weather", 1)


def part(first: int, last: int) -> Trace:
    cut = Cycle.from_samples("part", np.arange(last - first + 1), NYCC.speed_mps[first : last + 1])
    return Trace.of(cut, VEHICLE)


@settings(max_examples=40, deadline=None)
@given(known=st.integers(10, 300), step=st.integers(0, 149), short=st.integers(1, 20))
def test_stages_of_a_trip_that_is_not_as_long_as_forecast(
    known: int, step: int, short: int
) -> None:
    truth, guess = part(0, 150), part(0, known)
    builder = StageBuilder(VEHICLE, truth, guess, HorizonSettings(short_stages=short))
    stages = builder.at(step)
    seen = min(short, 150 - step)
    assert len(stages.duration_s) == builder.count
    assert stages.duration_s[:short].sum() == seen
    beyond = 0 if step + short >= 150 else known - builder.beyond(step)
    assert stages.duration_s[short:].sum() == beyond
    assert np.isfinite(stages.net_w).all()


@pytest.mark.parametrize("known", [60, 400])
def test_a_trip_longer_or_shorter_than_forecast_is_driven_within_limits(known: int) -> None:
    cycle = Cycle.from_samples("part", np.arange(201), NYCC.speed_mps[:201])
    run = simulate(cycle, "mh-qp", VEHICLE, forecast=part(0, known))
    found = run.summary()
    assert not any(found["violations"].values())
    assert found["fallback_steps"] == 0
    # the band of 1 % above the initial SOC, and what five seconds of sight cannot correct
    assert abs(found["soc_end"] - 0.6) < 0.03
