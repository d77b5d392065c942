"""PWA fits: convex, within their proven bounds, with as few pieces as the tolerance allows."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qpmpc.errors import InputError
from qpmpc.pwa import PwaModel, fit_convex
from qpmpc.pwa.model import alpha_samples
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine, alpha


def test_parabola_has_the_known_minimax_error():
    # On [0, 1] the best n equal segments of x^2 err by (1/n)^2 / 8.
    x = np.linspace(0.0, 1.0, 4001)
    fit = fit_convex(x, x**2, 1.0 / (8 * 16) * 1.0001)
    assert fit.pieces == 4
    assert max(fit.below, fit.above) == pytest.approx(1.0 / (8 * 16), rel=1e-3)
    np.testing.assert_allclose(np.diff(fit.breakpoints), 0.25, atol=2e-3)


@settings(max_examples=30, deadline=None)
@given(
    a=st.floats(0.1, 5.0), b=st.floats(-3.0, 3.0), c=st.floats(0.0, 2.0), tol=st.floats(1e-3, 0.2)
)
@example(
    a=0.45, b=0.0, c=0.0, tol=0.10000000000000002
)  # two pieces to the last sample, to round-off
def test_bounds_hold_between_the_samples_too(a, b, c, tol):
    def f(x):
        return a * x**2 + b * x + c * np.exp(x)

    x = np.linspace(-1.0, 2.0, 601)
    curvature = 2 * a + c * np.exp(2.0)
    fit = fit_convex(x, f(x), tol, interpolation_error=curvature * (3.0 / 600) ** 2 / 8)
    dense = np.linspace(-1.0, 2.0, 20011)
    error = fit(dense) - f(dense)
    assert error.min() >= -fit.below - 1e-12
    assert error.max() <= fit.above + 1e-12
    assert max(fit.below, fit.above) <= 1.01 * tol + curvature * (3.0 / 600) ** 2 / 8
    assert np.all(np.diff(fit.slope) > 0.0)
    assert np.all(fit.under_estimator()(dense) <= f(dense) + 1e-12)
    assert np.all(fit.over_estimator()(dense) >= f(dense) - 1e-12)


def test_a_finer_tolerance_never_needs_fewer_pieces():
    x = np.linspace(0.0, 3.0, 1000)
    counts = [fit_convex(x, np.exp(x), tol).pieces for tol in (1.0, 0.3, 0.1, 0.03, 0.01)]
    assert counts == sorted(counts)
    assert counts[-1] > counts[0]


def test_a_nonconvex_bump_is_bounded_honestly():
    x = np.linspace(0.0, 1.0, 501)
    f = x**2 + 0.05 * np.sin(8 * np.pi * x) ** 2
    fit = fit_convex(x, f, 0.01)
    error = fit(x) - f
    assert -error.min() <= fit.below + 1e-12
    assert fit.below > 0.03  # the bump cannot be followed by a convex function


@pytest.mark.parametrize(
    ("x", "tol"), [([0.0, 1.0], 0.1), ([0.0, 1.0, 1.0], 0.1), ([0.0, 1.0, 2.0], 0.0)]
)
def test_bad_arguments_are_refused(x, tol):
    with pytest.raises(InputError):
        fit_convex(x, np.zeros(len(x)), tol)


@pytest.mark.parametrize("name", ["prius-nimh", "prius-liion"])
def test_the_vehicles_curves_are_within_their_proven_bounds(name):
    vehicle = load_vehicle(name)
    model = PwaModel.of(vehicle)
    maps = BatteryMaps(vehicle.battery)
    power = np.linspace(-vehicle.battery_charge_max_w, vehicle.battery_discharge_max_w, 50_011)
    line = OptimalLine(vehicle.engine)
    p_eng = np.linspace(0.0, 71e3, 50_011)
    t = alpha_samples(vehicle)[0]
    t = np.linspace(t[0], t[-1], 50_011)
    for fit, x, f in (
        (model.battery, power, maps.internal_power_w(vehicle.trip.soc_init, power)),
        (model.fuel, p_eng, line.fuel(p_eng)),
        (model.alpha, t, alpha(vehicle.cold_engine, t)),
    ):
        error = fit(x) - f
        slack = 1e-9 * np.abs(f).max()
        assert -fit.below - slack <= error.min()
        assert error.max() <= fit.above + slack


def test_active_slope_is_the_derivative():
    x = np.linspace(0.0, 3.0, 1000)
    fit = fit_convex(x, np.exp(x), 0.1)
    inner = np.linspace(0.01, 2.99, 97)
    numeric = (fit(inner + 1e-7) - fit(inner - 1e-7)) / 2e-7
    np.testing.assert_allclose(fit.active_slope(inner), numeric, rtol=1e-6)


def test_vehicles_in_other_weather_share_the_fits_and_nobody_can_change_them() -> None:
    vehicle = load_vehicle()
    ours = PwaModel.of(vehicle)
    cold = PwaModel.of(vehicle.with_settings({"thermal.t_amb_degc": -12.5}))
    assert cold.fuel is ours.fuel
    assert cold.battery.breakpoints[-1] < ours.battery.breakpoints[-1]  # it gives less there
    as_strong = PwaModel.of(vehicle.with_settings({"thermal.cabin_heat_w": 2e3}))
    assert as_strong.battery is ours.battery
    assert cold.alpha is ours.alpha
    arctic = PwaModel.of(vehicle.with_settings({"thermal.t_amb_degc": -35.0}))
    assert arctic.alpha.breakpoints[0] == -35.0  # its range begins there
    charged = PwaModel.of(vehicle.with_settings({"trip.soc_init": 0.7}))
    assert charged.fuel is ours.fuel
    assert not np.array_equal(charged.battery.slope, ours.battery.slope)
    for array in (ours.fuel.slope, ours.alpha.breakpoints, ours.line.fuel_g_per_s):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
