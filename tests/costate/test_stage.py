"""The least of a stage against every power tried, on curves of any shape."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.pwa.curves import FUEL_TOLERANCE_G_PER_S, Curves, chords
from qpmpc.pwa.priced import StagePrices, least
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import optimal_line

VEHICLES = [load_vehicle(name) for name in ("prius-nimh", "paper-liion", "sonata-hybrid")]


@st.composite
def curves(draw):
    """Fuel rises with power in steps of any slope: convex, concave or neither."""
    count = draw(st.integers(1, 8))
    slopes = draw(st.lists(st.floats(2e-5, 2e-4), min_size=count, max_size=count))
    widths = draw(st.lists(st.floats(500.0, 12e3), min_size=count, max_size=count))
    power = np.append(0.0, np.cumsum(widths))
    fuel = draw(st.floats(0.0, 0.4)) + np.append(0.0, np.cumsum(np.multiply(slopes, widths)))
    ohms = [draw(st.floats(0.05, 0.4)) for _ in range(2)]
    return Curves.through(power, fuel, draw(st.floats(200.0, 400.0)) ** 2, *ohms)


PRICES = {
    "fuel": st.floats(-1.0, 3.0),
    "power": st.floats(-5e-5, 5e-5),
    "internal": st.floats(0.0, 2e-4) | st.just(0.0),
}


@given(curves(), st.floats(-25e3, 40e3), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.data())
def test_no_power_costs_less(made, net, share, width, data):
    w = {name: data.draw(price) for name, price in PRICES.items()}
    most = float(made.end_w[-1])
    strongest = 0.99 * made.square_v2 / (4.0 * made.discharge_ohm)  # of the battery
    low = min(max(share * most, net - strongest), most)
    net = min(net, low + strongest)
    high = low + width * (most - low)
    one = np.ones(1)
    prices = StagePrices(w["fuel"] * one, w["power"] * one, w["internal"] * one)
    found = least(made, net * one, low * one, high * one, prices)
    power = np.linspace(low, high, 3001)
    internal = made.internal_w(net - power)
    cost = w["fuel"] * made.fuel_g_per_s(power) + w["power"] * power + w["internal"] * internal
    size = np.abs(cost).max()
    assert low - 1e-6 <= found.power_w[0] <= high + 1e-6
    assert found.cost[0] <= cost.min() + 1e-9 * size + 1e-12
    # and it is the cost of the power that is returned
    at = found.power_w
    its = w["fuel"] * found.fuel_g_per_s + w["power"] * at + w["internal"] * found.internal_w
    assert abs(found.cost[0] - its[0]) <= 1e-9 * size + 1e-12
    assert abs(made.fuel_g_per_s(at)[0] - found.fuel_g_per_s[0]) < 1e-9


def test_the_curves_are_the_vehicles_own():
    for vehicle in VEHICLES:
        line, maps = optimal_line(vehicle.engine), BatteryMaps(vehicle.battery)
        made = Curves.of(vehicle, line)
        off = np.abs(made.fuel_g_per_s(line.power_w) - line.fuel_g_per_s).max()
        assert off <= FUEL_TOLERANCE_G_PER_S
        assert len(made.slope) < 40
        power = np.linspace(-vehicle.battery_charge_max_w, vehicle.battery_discharge_max_w, 401)
        np.testing.assert_allclose(
            made.internal_w(power), maps.internal_power_w(vehicle.trip.soc_mean, power), atol=1e-6
        )


@given(curves())
def test_the_envelope_is_the_largest_convex_curve_below(made):
    shared = made.envelope()
    assert (np.diff(shared.slope) > -1e-15).all()
    power = np.append(made.begin_w, made.end_w[-1])
    fuel, below = made.fuel_g_per_s(power), shared.fuel_g_per_s(power)
    assert (below <= fuel + 1e-12).all()
    # largest: it touches the curve at each of its own corners
    corners = np.append(shared.begin_w, shared.end_w[-1])
    np.testing.assert_allclose(made.fuel_g_per_s(corners), shared.fuel_g_per_s(corners))


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=60), st.floats(1e-3, 0.5))
def test_chords_stay_within_their_tolerance(values, tolerance):
    x, y = np.arange(len(values), dtype=float), np.array(values)
    allowed = tolerance * np.linspace(1.0, 2.0, len(x))
    kept = chords(x, y, allowed)
    assert kept[0] == 0
    assert kept[-1] == len(x) - 1
    assert (np.abs(np.interp(x, x[kept], y[kept]) - y) <= allowed + 1e-12).all()
