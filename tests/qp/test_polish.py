"""The first second at the plan's prices: its least cost, within its limits, or as planned."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qpmpc import Trip
from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.realise import STAY_SHARE
from qpmpc.controllers.settings import PAPER, BaselineMpcSettings, ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp, Var
from qpmpc.qp.polish import LINE_KNEE_W, LINE_TOLERANCE_G_PER_S, Polish, Prices
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.engine import LINE_STEP_W, optimal_line
from qpmpc.verification.independent.equations import Equations

CARS = {name: load_vehicle(name) for name in ("prius-nimh", "prius-liion")}
MODELS = {name: PwaModel.of(car) for name, car in CARS.items()}
POLISHES = {name: Polish(CARS[name], MODELS[name]) for name in CARS}
POINTS = 20_001


def limits_w(car, net_w):
    """Least and most engine power, engine on, with what the battery can add and take."""
    engine = car.engine
    low = max(engine.power_min_w, net_w - car.battery_discharge_max_w)
    return low, max(min(engine.power_max_w, net_w + car.battery_charge_max_w), low)


def fuel_of_line(name, power_w):
    line = optimal_line(CARS[name].engine)
    return np.interp(power_w, line.power_w, line.fuel_g_per_s)


def fuel_of_chords(name, power_w):
    return POLISHES[name].curves.fuel_g_per_s(power_w)


def cost_of(name, prices, net_w, power_w, fuel_of=fuel_of_line):
    """w_F f(E) + w_E E + w_G l(P0 - E), with l of the equations written a second time."""
    car, power = CARS[name], np.asarray(power_w)
    drawn_w = Equations(car).internal_w(car.trip.soc_init, net_w - power)
    burnt = fuel_of(name, power)
    return prices.fuel * burnt + prices.p_eng * power + prices.internal * drawn_w


# A gram of fuel is 44 kJ, of which some 16 kJ reach the store: 6e-5 g/J is a usual price.
@settings(max_examples=300, deadline=None)
@given(
    name=st.sampled_from(sorted(CARS)),
    fuel=st.floats(0.0, 3.0),
    p_eng=st.floats(-3e-5, 3e-5),
    internal=st.floats(1e-6, 3e-4),
    net_w=st.floats(-24e3, 75e3),
)
@example("prius-nimh", 1.0, -2e-6, 6e-5, 8e3)
@example("prius-nimh", 1.0, -9e-5, 6e-5, 8e3)  # work for nothing: as much as can be
def test_no_power_of_a_fine_grid_costs_less(name, fuel, p_eng, internal, net_w) -> None:
    prices, car = Prices(fuel, p_eng, internal), CARS[name]
    low, high = limits_w(car, net_w)
    found = POLISHES[name].power_w(prices, net_w, 12.0)
    assert low <= found <= high
    power = np.append(np.linspace(low, high, POINTS), found)
    cost = cost_of(name, prices, net_w, power)
    # chords are as near to the line as their tolerance, here and where it would cost less
    chord_g = fuel * LINE_TOLERANCE_G_PER_S * np.maximum(power / LINE_KNEE_W, 1.0) ** 2
    assert cost[-1] - chord_g[-1] <= (cost + chord_g).min() + 1e-12 * np.abs(cost).max()
    kinks = POLISHES[name].curves.begin_w
    power = np.append(power, kinks[(kinks > low) & (kinks < high)])
    cost = cost_of(name, prices, net_w, power, fuel_of_chords)
    assert cost[POINTS] <= cost.min() + 1e-12 * np.abs(cost).max()


def test_it_knows_where_the_slope_of_the_engines_line_jumps() -> None:
    """By an eighth at 11.5 kW, the fit's at 11.7 kW: many a second is best just there."""
    name, polish = "prius-nimh", POLISHES["prius-nimh"]
    line, of_fit_w = optimal_line(CARS[name].engine), MODELS[name].fuel.breakpoints[1]
    jumps_w = line.power_w[1:-1][np.diff(line.fuel_g_per_s, 2) > 1e-7 * LINE_STEP_W]
    prices = Prices(1.0, 0.0, 6e-5)
    for net_w in (400.0, 2e3, 4e3, 6e3):
        found_w = polish.power_w(prices, net_w, 0.0)
        assert np.abs(jumps_w - found_w).min() <= LINE_STEP_W
        assert abs(of_fit_w - found_w) > 2.0 * LINE_STEP_W
        found, of_fit = cost_of(name, prices, net_w, [found_w, of_fit_w])
        assert found < of_fit


def test_it_is_an_optimum_that_moves_with_the_prices() -> None:
    """Between limits and kinks 1 W more or less costs more; dearer charge, more power."""
    powers = []
    for internal in (5.8e-5, 6.0e-5, 6.3e-5):
        prices = Prices(1.0, 0.0, internal)
        found = POLISHES["prius-nimh"].power_w(prices, 12e3, 0.0)
        around_w = [found - 1.0, found, found + 1.0]
        costs = cost_of("prius-nimh", prices, 12e3, around_w, fuel_of_chords)
        assert costs[1] < min(costs[0], costs[2])
        powers.append(found)
    assert powers == sorted(powers)
    assert powers[-1] > powers[0] + 1e3


@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from(sorted(CARS)),
    fuel=st.floats(-1e6, 1e6),
    p_eng=st.floats(-1e6, 1e6),
    internal=st.floats(1e-300, 1e6),
    net_w=st.floats(-24e3, 120e3),
)
def test_whatever_the_prices_the_limits_are_kept(name, fuel, p_eng, internal, net_w) -> None:
    low, high = limits_w(CARS[name], net_w)
    with np.errstate(over="ignore"):  # of prices a billion times apart
        assert low <= POLISHES[name].power_w(Prices(fuel, p_eng, internal), net_w, 0.0) <= high


@pytest.mark.parametrize("internal", [0.0, -1e-5, -np.inf, np.nan])
def test_without_a_price_of_charge_the_planned_power_stays(internal) -> None:
    polish = POLISHES["prius-nimh"]
    assert polish.power_w(Prices(1.0, 0.0, internal), 12e3, 9876.5) == 9876.5


@settings(max_examples=30, deadline=None)
@given(step=st.integers(0, 590), seed=st.integers(0, 1000))
def test_prices_are_cost_and_duals_of_the_dynamics(step, seed) -> None:
    """Column by column of the first stage: what q + A'y of the rows `soc` and `t_cl` adds up to."""
    car = CARS["prius-nimh"]
    trace = Trace.of(load_cycle("nycc"), car)
    builder = StageBuilder(car, trace, trace, HorizonSettings())
    qp = StageQp(car, MODELS["prius-nimh"], builder.count, QpSettings(), ScalingSettings())
    about = Linearisation.constant(builder.count, 50.0, 0.4)
    data = qp.update(builder.at(step), 0.6, 50.0, about)
    duals = np.random.default_rng(seed).normal(size=(qp.stages, qp.rows.count))
    scaling = data.scaling
    a = qp.structure.matrix_of(data.a_data).toarray() / scaling.row[:, None] / scaling.column
    dynamic = np.zeros_like(duals)
    for name in ("soc", "t_cl"):
        dynamic[0, qp.rows.first(name)] = duals[0, qp.rows.first(name)]
    expected = data.q / scaling.column / scaling.cost + a.T @ dynamic.ravel()
    found = qp.prices(duals)
    for price, var in zip(found, (Var.FUEL, Var.P_ENG, Var.INTERNAL), strict=True):
        assert price == pytest.approx(expected[var], rel=1e-9, abs=1e-15)


def test_the_planner_polishes_its_first_second_alone_and_only_if_told() -> None:
    trip = Trip("nycc")
    with_it = ControllerSettings().with_settings({"mh_qp.implementation": "python"})
    without = with_it.with_settings({"mh_qp.polish": False})
    planners = [QpPlanner(trip, each) for each in (with_it, without)]
    for planner in planners:
        planner.depart(trip.start)
    differing = 0
    for step in range(120, 180):
        seen = trip.start._replace(
            step=step,
            soc=0.55,
            demand_w=float(trip.truth.demand_w[step]),
            speed_mps=float(trip.truth.speed_mps[step]),
        )
        polished, planned = (planner.plan(seen) for planner in planners)
        np.testing.assert_array_equal(polished.on_share, planned.on_share)
        np.testing.assert_array_equal(polished.power_on_w[1:], planned.power_on_w[1:])
        differs = polished.power_on_w[0] != planned.power_on_w[0]
        assert not differs or planned.on_share[0] >= STAY_SHARE
        differing += differs
    assert differing > 3


def test_the_papers_controllers_do_without() -> None:
    assert ControllerSettings().mh_qp.polish
    assert not PAPER.polish
    assert not BaselineMpcSettings().as_mh_qp().polish
