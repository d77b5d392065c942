"""Coolant over a stage with its thermostat: against brute force, and where it must be simple."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qpmpc.qp.coolant import radiator_w_per_k, thermostat_step
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.heat import radiator_w

VEHICLE = load_vehicle()
THERMAL = VEHICLE.thermal
durations = st.floats(0.0, 300.0)
temperatures = st.floats(40.0, 92.0)
heats = st.floats(-20e3, 30e3)


def _step(duration_s, start_degc, heat_w):
    opens = THERMAL.thermostat_open_degc
    inputs = (np.array([v]) for v in (duration_s, start_degc - opens, heat_w))
    end_k, per_heat, per_start = (float(part[0]) for part in thermostat_step(THERMAL, *inputs))
    return end_k + opens, per_heat, per_start


def _brute_force(duration_s, start_degc, heat_w, steps=20_000):
    slope, t = radiator_w_per_k(THERMAL), start_degc
    for _ in range(steps):
        radiator_w = slope * max(t - THERMAL.thermostat_open_degc, 0.0)
        t += duration_s / steps * (heat_w - radiator_w) / THERMAL.heat_capacity_j_per_k
    return t


@pytest.mark.parametrize(
    ("duration_s", "start_degc", "heat_w"),
    [
        (200.0, 60.0, 5e3),  # closed all the time
        (200.0, 80.0, 15e3),  # opens
        (200.0, 88.0, 8e3),  # open all the time
        (200.0, 88.0, -5e3),  # closes
        (1.0, 84.99, 20e3),
    ],
)
def test_end_is_that_of_many_small_steps(duration_s, start_degc, heat_w):
    expected = _brute_force(duration_s, start_degc, heat_w)
    assert _step(duration_s, start_degc, heat_w)[0] == pytest.approx(expected, abs=1e-3)


# Where the thermostat just opens or closes the derivative jumps: it is between both sides' slopes.
@settings(max_examples=300, deadline=None)
@given(duration_s=durations, start_degc=temperatures, heat_w=heats)
@example(duration_s=1.0, start_degc=85.0, heat_w=0.0)
@example(duration_s=300.0, start_degc=85.02, heat_w=0.001)
@example(duration_s=300.0, start_degc=84.99999, heat_w=0.0)
def test_derivatives_are_those_of_the_end(duration_s, start_degc, heat_w):
    end, per_heat, per_start = _step(duration_s, start_degc, heat_w)
    dq, dt = 1e-2, 1e-5
    up = (_step(duration_s, start_degc, heat_w + dq)[0] - end) / dq
    down = (end - _step(duration_s, start_degc, heat_w - dq)[0]) / dq
    assert min(up, down) * (1.0 - 1e-4) - 1e-7 <= per_heat <= max(up, down) * (1.0 + 1e-4) + 1e-7
    up = (_step(duration_s, start_degc + dt, heat_w)[0] - end) / dt
    down = (end - _step(duration_s, start_degc - dt, heat_w)[0]) / dt
    assert min(up, down) - 1e-4 <= per_start <= max(up, down) + 1e-4


@settings(max_examples=300, deadline=None)
@given(duration_s=durations, start_degc=temperatures, heat_w=heats)
def test_radiator_only_cools_and_more_heat_or_a_warmer_start_never_end_colder(
    duration_s, start_degc, heat_w
):
    end, per_heat, per_start = _step(duration_s, start_degc, heat_w)
    capacity = THERMAL.heat_capacity_j_per_k
    assert end <= start_degc + duration_s * heat_w / capacity + 1e-9
    assert 0.0 <= per_heat <= duration_s / capacity * (1.0 + 1e-9)
    assert 0.0 <= per_start <= 1.0


def test_chord_of_the_radiator_is_near_the_plant_and_above():
    slope = radiator_w_per_k(THERMAL)
    span = THERMAL.thermostat_span_k
    for t in np.linspace(THERMAL.thermostat_open_degc, THERMAL.t_cl_max_degc, 21):
        above = slope * (t - THERMAL.thermostat_open_degc) - radiator_w(THERMAL, float(t))
        assert -1e-6 <= above <= THERMAL.radiator_w_per_k * span / 4.0 + 1e-6


@pytest.mark.parametrize("real", [np.float64, np.float32])
@pytest.mark.parametrize("heat_w", [-20e3, -300.0, 0.0, 300.0, 20e3])
@pytest.mark.parametrize("start_k", [-40.0, -0.1, 0.0, 0.1, 5.0])
def test_without_a_radiator_the_coolant_is_a_plain_store(real, heat_w, start_k):
    """Also in the arithmetic of small processors, where small differences of large numbers end."""
    without = THERMAL.model_copy(update={"radiator_w_per_k": 0.0})
    capacity, duration_s = without.heat_capacity_j_per_k, 120.0
    inputs = (np.array([value], dtype=real) for value in (duration_s, start_k, heat_w))
    end_k, per_heat, per_start = thermostat_step(without, *inputs)
    assert end_k.dtype == real
    tolerance = 1e-5 if real is np.float64 else 1e-4
    assert end_k[0] == pytest.approx(start_k + heat_w * duration_s / capacity, abs=40 * tolerance)
    assert per_heat[0] == pytest.approx(duration_s / capacity, rel=tolerance)
    assert per_start[0] == pytest.approx(1.0, rel=tolerance)
