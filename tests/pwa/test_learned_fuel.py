"""Learning of the fuel map: right from exact measurements, bounded whatever is measured."""

from collections.abc import Sequence
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.pwa.fit import convex_envelope
from qpmpc.pwa.learned_fuel import IDLE_MOST, LATE_S, SLOPE_MOST, LearnedFuel
from qpmpc.pwa.model import PwaModel, PwaTolerances, learned_fuel
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.engine import alpha_at, optimal_line

VEHICLE = load_vehicle()
ENGINE, LINE = VEHICLE.engine, optimal_line(VEHICLE.engine)


def learner() -> LearnedFuel:
    return learned_fuel(VEHICLE, PwaTolerances())


def burnt_g(idle: float, slope: float, power_w: float, t_cl_degc: float, started: bool) -> float:
    more = idle + slope * power_w / ENGINE.power_max_w
    hot = LINE.fuel.at(power_w) + more * LINE.fuel_g_per_s[-1]
    return alpha_at(VEHICLE.cold_engine, t_cl_degc) * hot + ENGINE.start_fuel_g * started


def taught(
    idle: float,
    slope: float,
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
        burnt[k] = burnt_g(idle, slope, power_w, t_cl_degc, started) if is_on else 0.0
        fuel_g = sum(part * burnt[k - late] for late, part in enumerate(arrives) if late <= k)
        found.take(float(fuel_g), power_w, t_cl_degc, is_on, started)
    return found


POWERS = {"low_w": st.floats(2e3, 30e3), "apart_w": st.floats(10e3, 35e3)}


@settings(max_examples=50, deadline=None)
@given(idle=st.floats(-0.02, 0.03), slope=st.floats(-0.2, 0.2), **POWERS)
def test_exact_measurements_at_two_powers_lead_to_the_truth(idle, slope, low_w, apart_w) -> None:
    """An engine that idles for a fifth, or for twice as much. What is left is the map's weight."""
    found = taught(idle, slope, [low_w, low_w + apart_w], 600)
    assert found.idle_and_slope == (
        pytest.approx(idle, abs=2e-3),
        pytest.approx(slope, abs=6e-3),
    )


ARRIVALS = [(0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.5, 0.5), (0.6, 0.3, 0.1)]


@settings(max_examples=30, deadline=None)
@given(arrives=st.sampled_from(ARRIVALS), **POWERS)
def test_a_meter_that_is_late_does_not_mislead_where_the_map_is_right(arrives, low_w, apart_w):
    """Where each second was compared with the map alone, a delay of 1 s led to tilts of 0.25."""
    found = taught(0.0, 0.0, [low_w, low_w + apart_w], 600, arrives)
    assert found.idle_and_slope == pytest.approx((0.0, 0.0), abs=1e-4)


@settings(max_examples=30, deadline=None)
@given(slope=st.sampled_from([-0.1, 0.1]), arrives=st.sampled_from(ARRIVALS), **POWERS)
def test_a_meter_that_is_late_teaches_a_slope(slope, arrives, low_w, apart_w) -> None:
    """What is left is of the seconds before the delay was known."""
    found = taught(0.0, slope, [low_w, low_w + apart_w], 600, arrives)
    assert found.idle_and_slope[1] == pytest.approx(slope, abs=4e-3)


def test_at_one_power_alone_the_rate_there_is_learned() -> None:
    found = taught(0.0, 0.1, [15e3], 200)
    fuel = float(found.curve(np.array(15e3)))
    chord = float(learner().curve(np.array(15e3))) / LINE.fuel.at(15e3)  # between breakpoints
    assert fuel == pytest.approx(chord * burnt_g(0.0, 0.1, 15e3, 90.0, False), rel=2e-3)


def test_old_measurements_are_forgotten() -> None:
    """An engine that changes: after 3 times the memory, exp(-3) of what was is left."""
    found = taught(0.02, 0.0, [10e3, 25e3], 900)
    for k in range(2700):
        power_w = (10e3, 25e3)[k // 8 % 2]
        found.take(burnt_g(-0.01, 0.0, power_w, 90.0, False), power_w, 90.0, True, False)
    assert found.idle_and_slope[0] == pytest.approx(-0.01, abs=0.03 * np.exp(-3.0) * 1.1)


def test_idle_fuel_is_learned_from_powers_far_above_it() -> None:
    """FASTSim's engine idles for nothing, and a map that says otherwise keeps it from idling."""
    idles_g = float(LINE.fuel_g_per_s[0])
    found = taught(-0.9 * idles_g / float(LINE.fuel_g_per_s[-1]), 0.05, [12e3, 20e3], 120)
    assert float(found.curve(np.array(0.0))) < 0.3 * idles_g


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
    idle, slope = found.idle_and_slope
    assert abs(idle) <= IDLE_MOST
    assert abs(slope) <= SLOPE_MOST
    curve = found.curve
    assert np.all(np.diff(curve.slope) >= -1e-18)
    assert curve.slope[0] > 0.0
    assert curve(0.0) >= 0.0
    line = found.map_g_per_s[-1] * (idle + slope * found.power_w / ENGINE.power_max_w)
    wanted = convex_envelope(found.power_w, found.map_g_per_s + line)
    np.testing.assert_allclose(curve(found.power_w), wanted, rtol=1e-9, atol=1e-12)


def test_before_anything_is_learned_the_curve_is_the_map_to_the_fit_s_tolerance() -> None:
    """Chords lie above a convex line by no more than twice the fit's tolerance."""
    tolerances = PwaTolerances()
    curve = PwaModel.of(VEHICLE, tolerances, learning=True).fuel
    allowed = tolerances.fuel_g_per_s * np.maximum(LINE.power_w / tolerances.fuel_knee_w, 1.0) ** 2
    envelope = convex_envelope(LINE.power_w, LINE.fuel_g_per_s)
    assert np.all(np.abs(curve(LINE.power_w) - envelope) <= 2.5 * allowed)
    found = taught(0.02, 0.1, [10e3, 25e3], 100)
    found.forget()
    np.testing.assert_array_equal(found.curve.slope, curve.slope)


def test_an_engine_at_full_power_teaches_nothing() -> None:
    """Its greatest power also stands for a power that is not known."""
    found = learner()
    found.take(6.0, ENGINE.power_max_w, 90.0, True, False)
    for _ in range(LATE_S):  # in which its fuel may come
        found.take(1.1 * LINE.fuel.at(15e3), 15e3, 90.0, True, False)
    assert found.idle_and_slope == (0.0, 0.0)
    for _ in range(10):
        found.take(1.1 * LINE.fuel.at(15e3), 15e3, 90.0, True, False)
    assert sum(found.idle_and_slope) > 0.01
