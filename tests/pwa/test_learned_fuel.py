"""Learning of the fuel map: right from exact measurements, bounded whatever is measured."""

from collections.abc import Sequence
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.pwa.fit import convex_envelope
from qpmpc.pwa.learned_fuel import LATE_S, LEVEL_MOST, TILT_MOST, LearnedFuel
from qpmpc.pwa.model import PwaModel, PwaTolerances, learned_fuel
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.engine import alpha_at, optimal_line

VEHICLE = load_vehicle()
ENGINE, LINE = VEHICLE.engine, optimal_line(VEHICLE.engine)


def learner() -> LearnedFuel:
    return learned_fuel(VEHICLE, PwaTolerances())


def burnt_g(level: float, tilt: float, power_w: float, t_cl_degc: float, started: bool) -> float:
    share = 2.0 * power_w / ENGINE.power_max_w - 1.0
    hot = LINE.fuel.at(power_w) * (level + tilt * share)
    return alpha_at(VEHICLE.cold_engine, t_cl_degc) * hot + ENGINE.start_fuel_g * started


def taught(
    level: float,
    tilt: float,
    powers_w: list[float],
    seconds: int,
    arrives: Sequence[float] = (1.0,),
) -> LearnedFuel:
    """Return what was taught in runs of 17 s; `arrives`: shares of fuel 0, 1, 2 .. s late."""
    found = learner()
    burnt = np.zeros(seconds)
    for k in range(seconds):
        is_on = k % 22 < 17
        power_w = powers_w[k // 3 % len(powers_w)] if is_on else 0.0
        t_cl_degc, started = 40.0 + 0.1 * (k % 300), k % 22 == 0
        burnt[k] = burnt_g(level, tilt, power_w, t_cl_degc, started) if is_on else 0.0
        fuel_g = sum(part * burnt[k - late] for late, part in enumerate(arrives) if late <= k)
        found.take(float(fuel_g), power_w, t_cl_degc, is_on, started)
    return found


POWERS = {"low_w": st.floats(2e3, 30e3), "apart_w": st.floats(10e3, 35e3)}


@settings(max_examples=50, deadline=None)
@given(level=st.floats(0.8, 1.2), tilt=st.floats(-0.15, 0.15), **POWERS)
def test_exact_measurements_at_two_powers_lead_to_the_truth(level, tilt, low_w, apart_w) -> None:
    """What is left is the weight of the map, most where the engine gives 2 kW and 12 kW."""
    found = taught(level, tilt, [low_w, low_w + apart_w], 600)
    assert found.level_and_tilt == pytest.approx((level, tilt), abs=0.01)


ARRIVALS = [(0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.5, 0.5), (0.6, 0.3, 0.1)]


@settings(max_examples=30, deadline=None)
@given(arrives=st.sampled_from(ARRIVALS), **POWERS)
def test_a_meter_that_is_late_does_not_mislead_where_the_map_is_right(arrives, low_w, apart_w):
    """Where each second was compared with the map alone, a delay of 1 s led to tilts of 0.25."""
    found = taught(1.0, 0.0, [low_w, low_w + apart_w], 600, arrives)
    assert found.level_and_tilt == pytest.approx((1.0, 0.0), abs=2e-3)


@settings(max_examples=30, deadline=None)
@given(tilt=st.sampled_from([-0.1, 0.1]), arrives=st.sampled_from(ARRIVALS), **POWERS)
def test_a_meter_that_is_late_teaches_a_tilt(tilt, arrives, low_w, apart_w) -> None:
    """What is left is of the seconds before the delay was known: 18 % at the lowest powers."""
    found = taught(1.0, tilt, [low_w, low_w + apart_w], 600, arrives)
    assert found.level_and_tilt[1] == pytest.approx(tilt, abs=0.03)


def test_at_one_power_alone_the_rate_there_is_learned() -> None:
    found = taught(1.0, 0.1, [15e3], 200)
    fuel = float(found.curve(np.array(15e3)))
    chord = float(learner().curve(np.array(15e3))) / LINE.fuel.at(15e3)  # between breakpoints
    assert fuel == pytest.approx(chord * burnt_g(1.0, 0.1, 15e3, 90.0, False), rel=2e-3)


def test_old_measurements_are_forgotten() -> None:
    """An engine that changes: after 3 times the memory, exp(-3) of what was is left."""
    found = taught(1.1, 0.0, [10e3, 25e3], 900)
    for k in range(2700):
        power_w = (10e3, 25e3)[k // 8 % 2]
        found.take(burnt_g(0.95, 0.0, power_w, 90.0, False), power_w, 90.0, True, False)
    assert found.level_and_tilt[0] == pytest.approx(0.95, abs=0.15 * np.exp(-3.0) * 1.1)


NUMBERS = st.one_of(st.floats(-1e3, 1e3), st.sampled_from([nan, inf, -inf, 0.0, 1e300, -1e-300]))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            NUMBERS, st.floats(0.0, 1e6), st.floats(-50.0, 130.0), st.booleans(), st.booleans()
        ),
        max_size=60,
    )
)
def test_whatever_is_measured_the_curve_stays_convex_and_near_the_map(seconds) -> None:
    found = learner()
    for second in seconds:
        found.take(*second)
    level, tilt = found.level_and_tilt
    assert 1.0 - LEVEL_MOST <= level <= 1.0 + LEVEL_MOST
    assert abs(tilt) <= TILT_MOST
    curve = found.curve
    assert np.all(np.diff(curve.slope) >= -1e-18)
    share = 2.0 * found.power_w / ENGINE.power_max_w - 1.0
    wanted = convex_envelope(found.power_w, found.map_g_per_s * (level + tilt * share))
    np.testing.assert_allclose(curve(found.power_w), wanted, rtol=1e-9, atol=1e-12)


def test_before_anything_is_learned_the_curve_is_the_map_to_the_fit_s_tolerance() -> None:
    """Chords lie above a convex line by no more than twice the fit's tolerance."""
    tolerances = PwaTolerances()
    curve = PwaModel.of(VEHICLE, tolerances, learning=True).fuel
    allowed = tolerances.fuel_g_per_s * np.maximum(LINE.power_w / tolerances.fuel_knee_w, 1.0) ** 2
    envelope = convex_envelope(LINE.power_w, LINE.fuel_g_per_s)
    assert np.all(np.abs(curve(LINE.power_w) - envelope) <= 2.5 * allowed)
    found = taught(1.1, 0.1, [10e3, 25e3], 100)
    found.forget()
    np.testing.assert_array_equal(found.curve.slope, curve.slope)


def test_an_engine_at_full_power_teaches_nothing() -> None:
    """Its greatest power also stands for a power that is not known."""
    found = learner()
    found.take(6.0, ENGINE.power_max_w, 90.0, True, False)
    for _ in range(LATE_S):  # in which its fuel may come
        found.take(1.1 * LINE.fuel.at(15e3), 15e3, 90.0, True, False)
    assert found.level_and_tilt == (1.0, 0.0)
    for _ in range(10):
        found.take(1.1 * LINE.fuel.at(15e3), 15e3, 90.0, True, False)
    assert found.level_and_tilt[0] > 1.05
