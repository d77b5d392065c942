"""Engine map, optimal line, cold multiplier and battery against their sources."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.vehicle import Plant, load_vehicle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine, alpha, alpha_at, fuel_power_w

VEHICLE = load_vehicle()
LINE = OptimalLine(VEHICLE.engine)
MAPS = BatteryMaps(VEHICLE.battery)

# Reference optimal line of this map, kW -> g/s, four digits; made independently of this code.
REFERENCE = {
    0: 0.1144, 1: 0.1655, 5: 0.3698, 10: 0.6251, 14: 0.8457, 20: 1.1877, 30: 1.7525,
    40: 2.3268, 50: 2.9363, 60: 3.6514, 71: 4.5807,
}  # fmt: skip


@pytest.mark.parametrize(("power_kw", "fuel_g_per_s"), REFERENCE.items())
def test_optimal_line_matches_the_reference(power_kw, fuel_g_per_s):
    # 0.15 %: the reference was found on a speed grid of 20 rpm with its own torque limit.
    assert LINE.fuel.at(1e3 * power_kw) == pytest.approx(fuel_g_per_s, rel=1.5e-3)


def test_optimal_line_is_optimal_and_within_the_torque_limit():
    engine = VEHICLE.engine
    limit = np.interp(LINE.speed_rpm, engine.torque_speed_rpm, engine.torque_max_nm)
    assert np.all(LINE.torque_nm <= limit * (1.0 + 1e-9))
    rng = np.random.default_rng(1)
    for i in rng.integers(0, len(LINE.power_w), 200):
        speed = np.linspace(1000.0, 5200.0, 40_000)
        torque = LINE.power_w[i] / (speed * np.pi / 30.0)
        allowed = torque <= np.interp(speed, engine.torque_speed_rpm, engine.torque_max_nm)
        if allowed.any():
            best = fuel_power_w(engine, speed[allowed], LINE.power_w[i]).min()
            mine = LINE.fuel_g_per_s[i] * engine.lhv_j_per_kg * 1e-3
            assert mine <= best * (1.0 + 1e-9)
            assert mine >= best * (1.0 - 1e-5)  # what a speed step of 0.1 rpm may miss


def test_optimal_line_does_not_saw():
    # Speeds on a grid snap upwards: a sawtooth of up to 4.5e-4 g/s that an optimiser exploits. The
    # line bends where tables of the map do, and never by more than their slopes can.
    bends = np.diff(LINE.fuel_g_per_s, 2)
    assert bends.min() > -2e-6
    assert np.all(np.diff(LINE.speed_rpm) >= 0.0)


def test_peak_efficiency_is_that_of_the_real_engine():
    efficiency = LINE.power_w / (LINE.fuel_g_per_s * VEHICLE.engine.lhv_j_per_kg * 1e-3)
    assert efficiency.max() == pytest.approx(0.40, abs=0.015)


@pytest.mark.parametrize(
    ("t_cl_degc", "value"), [(40, 1.117), (50, 1.082), (60, 1.052), (70, 1.027), (80, 1.009)]
)
def test_cold_multiplier_values(t_cl_degc, value):
    assert alpha_at(VEHICLE.cold_engine, t_cl_degc) == pytest.approx(value, abs=6e-4)


def test_cold_multiplier_is_convex_decreasing_and_one_when_hot():
    t = np.linspace(-20.0, 110.0, 500)
    values = alpha(VEHICLE.cold_engine, t)
    assert np.all(np.diff(values) <= 1e-15)
    assert np.all(np.diff(values, 2) >= -1e-12)
    assert np.all(values[t >= 90.0] == 1.0)


@given(soc=st.floats(0.4, 0.8), power_w=st.floats(-25e3, 27e3))
def test_internal_power_solves_the_circuit(soc, power_w):
    # P = U I - R I^2 with I = G / U.
    internal = float(MAPS.internal_power_w(soc, power_w))
    voltage = MAPS.open_circuit.at(soc)
    table = MAPS.discharge if power_w >= 0 else MAPS.charge
    current = internal / voltage
    assert voltage * current - table.at(soc) * current**2 == pytest.approx(power_w, abs=1e-4)
    assert internal >= power_w - 1e-9
    assert MAPS.current_a(soc, power_w) == pytest.approx(current, abs=1e-7)


@given(soc=st.floats(0.4, 0.8))
def test_internal_power_is_convex_in_terminal_power(soc):
    power = np.linspace(-25e3, 27e3, 400)
    assert np.all(np.diff(MAPS.internal_power_w(soc, power), 2) >= -1e-6)


@given(soc=st.floats(0.4, 0.8))
def test_charge_limit_never_overfills(soc):
    power = Plant(VEHICLE).charge_limit_w(soc)
    after = soc - MAPS.current_a(soc, -power) / MAPS.charge_c
    assert after <= 0.8 + 1e-12
