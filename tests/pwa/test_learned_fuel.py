"""Learning of the fuel map: right from exact measurements, bounded whatever is measured."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.pwa.fit import convex_envelope
from qpmpc.pwa.learned_fuel import LEVEL_MOST, TILT_MOST, LearnedFuel
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


def taught(level: float, tilt: float, powers_w: list[float], seconds: int) -> LearnedFuel:
    found = learner()
    for k in range(seconds):
        power_w, t_cl_degc = powers_w[k % len(powers_w)], 40.0 + 0.1 * (k % 300)
        fuel_g = burnt_g(level, tilt, power_w, t_cl_degc, k % 20 == 0)
        found.take(fuel_g, power_w, t_cl_degc, k % 20 == 0)
    return found


@settings(max_examples=50, deadline=None)
@given(
    level=st.floats(0.8, 1.2),
    tilt=st.floats(-0.15, 0.15),
    low_w=st.floats(2e3, 30e3),
    apart_w=st.floats(10e3, 35e3),
)
def test_exact_measurements_at_two_powers_lead_to_the_truth(level, tilt, low_w, apart_w) -> None:
    """What is left is the weight of the map, PRIOR_S of 400 seconds 0.3 apart in p."""
    found = taught(level, tilt, [low_w, low_w + apart_w], 400)
    assert found.level_and_tilt == pytest.approx((level, tilt), abs=2e-3)


def test_at_one_power_alone_the_rate_there_is_learned() -> None:
    found = taught(1.0, 0.1, [15e3], 200)
    fuel = float(found.curve(np.array(15e3)))
    chord = float(learner().curve(np.array(15e3))) / LINE.fuel.at(15e3)  # between breakpoints
    assert fuel == pytest.approx(chord * burnt_g(1.0, 0.1, 15e3, 90.0, False), rel=2e-3)


def test_old_measurements_are_forgotten() -> None:
    """An engine that changes: after 3 times the memory, exp(-3) of what was is left."""
    found = taught(1.1, 0.0, [10e3, 25e3], 900)
    for k in range(2700):
        power_w = (10e3, 25e3)[k % 2]
        found.take(burnt_g(0.95, 0.0, power_w, 90.0, False), power_w, 90.0, False)
    assert found.level_and_tilt[0] == pytest.approx(0.95, abs=0.15 * np.exp(-3.0) * 1.1)


NUMBERS = st.one_of(st.floats(-1e3, 1e3), st.sampled_from([nan, inf, -inf, 0.0, 1e300, -1e-300]))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(NUMBERS, st.floats(0.0, 1e6), st.floats(-50.0, 130.0), st.booleans()), max_size=60
    )
)
def test_whatever_is_measured_the_curve_stays_convex_and_near_the_map(seconds) -> None:
    found = learner()
    for fuel_g, power_w, t_cl_degc, started in seconds:
        found.take(fuel_g, power_w, t_cl_degc, started)
    level, tilt = found.level_and_tilt
    assert abs(level - 1.0) <= LEVEL_MOST
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
    found.take(6.0, ENGINE.power_max_w, 90.0, False)
    assert found.level_and_tilt == (1.0, 0.0)
