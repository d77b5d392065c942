"""The smoothed dual: its slope is the excess of the limits, it is concave, Newton finds its top."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from small_program import program

from qpmpc import Trip, load_vehicle
from qpmpc.controllers.mh_costate import MhCostate
from qpmpc.costate.dual import Multipliers, _of_blocks, dual, smoothed
from qpmpc.costate.funnel import funnel
from qpmpc.costate.solve import newton
from qpmpc.qp.linearisation import Linearisation

MOST = 3e3
TARGET = 0.6  # SOC at arrival, unless it is eased
CARS = st.sampled_from(["prius-nimh", "prius-liion", "paper-nimh", "paper-liion"])
STATES = (CARS, st.integers(0, 58), st.floats(0.58, 0.62), st.floats(45.0, 88.0), st.booleans())


def multipliers(p, seed):
    rng = np.random.default_rng(seed)
    n = len(p.duration_s)
    charge = rng.uniform(60.0, 300.0) * rng.uniform(0.8, 1.2, n)
    heat = rng.normal(0.0, 0.5, n)
    return Multipliers(charge, heat)


@settings(deadline=None, max_examples=60)
@given(*STATES, st.integers(0, 1000))
def test_its_slope_is_what_the_stages_leave_of_the_limits(car, step, soc, t_cl, on, seed):
    p, _ = program(car, step, soc, t_cl, on)
    one, other = multipliers(p, seed), multipliers(p, seed + 1)
    here = dual(p, one)
    # of the jumps of lambda and of the coolant's multipliers
    jump = np.diff(other.charge - one.charge, append=0.0) * -1.0
    jump[-1] = (other.charge - one.charge)[-1]
    sign = one.charge - np.append(one.charge[1:], 0.0)
    limit = np.where(sign > 0.0, p.soc_low, p.soc_high)
    t_limit = np.where(one.heat > 0.0, p.t_low, p.t_high)
    slope = (jump * (limit - here.soc)).sum()
    slope += ((other.heat - one.heat) * (t_limit - here.t_cl_degc)).sum()
    step_size = 1e-6
    ahead = dual(p, one.towards(other, step_size))
    kept = np.sign(ahead.at.heat) == np.sign(one.heat)
    assert kept.all()
    size = np.abs(jump * p.soc_high).sum() + np.abs((other.heat - one.heat) * p.t_high).sum()
    # second order over the step; the start prices' floor at 0 and kinks of f add little
    assert (ahead.value - here.value) / step_size == pytest.approx(slope, abs=2e-3 * size + 1e-3)


@settings(deadline=None, max_examples=60)
@given(*STATES, st.integers(0, 1000))
def test_it_is_concave(car, step, soc, t_cl, on, seed):
    p, _ = program(car, step, soc, t_cl, on)
    one, other = multipliers(p, seed), multipliers(p, seed + 1)
    ends = dual(p, one).value, dual(p, other).value
    # not `towards`, which stops where a multiplier changes its sign
    half = Multipliers(0.5 * (one.charge + other.charge), 0.5 * (one.heat + other.heat))
    middle = dual(p, half).value
    assert middle >= 0.5 * sum(ends) - 1e-6 * (1.0 + max(map(abs, ends)))


@settings(deadline=None, max_examples=30)
@given(CARS, st.integers(0, 58), st.floats(0.58, 0.62), st.floats(51.0, 88.0), st.booleans())
@example("prius-nimh", 0, 0.609375, 51.0, False)
def test_newton_finds_its_top(car, step, soc, t_cl, on):
    """From two sides, to the same value, which never falls on the way; the limits can be kept."""
    p, _ = program(car, step, soc, t_cl, on)
    # one whose end is eased to what can just be reached has its top at endless prices
    assume(p.soc_low[-1] >= TARGET)
    n = len(p.duration_s)

    def top(guess: float, rounds: int) -> float:
        values = []
        start = Multipliers(np.full(n, guess), np.zeros(n))
        found = newton(p, start, rounds, MOST, lambda here: values.append(here.value)).value
        assert (np.diff([*values, found]) >= 0.0).all()
        return found

    # 60 rounds do but where the same switch has to keep the coolant and the SOC at the end, one at
    # a time: 11 of 1,800 states, most of them drawn on that edge
    few = top(60.0, 60), top(300.0, 60)
    if few[0] != pytest.approx(few[1], abs=0.02):
        assert top(60.0, 1000) == pytest.approx(top(300.0, 1000), abs=0.02)


def test_a_multiplier_of_the_coolant_ends_at_zero_on_its_way_to_the_other_limit():
    one = Multipliers(np.zeros(4), np.array([1.0, -1.0, 0.0, 1.0]))
    other = Multipliers(np.ones(4), np.array([-2.0, 2.0, -2.0, 0.0]))
    half, beyond = one.towards(other, 0.5), one.towards(other, 2.0)
    assert half.heat == pytest.approx([0.0, 0.0, -1.0, 0.5])
    assert beyond.heat == pytest.approx([0.0, 0.0, -4.0, 0.0])
    assert half.charge == pytest.approx(np.full(4, 0.5))


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 10**6))
def test_the_starts_of_a_block_in_closed_form_are_those_of_a_walk(seed):
    """Demand that rises and that falls into a class, narrow and wide switches, ends of limits."""
    rng = np.random.default_rng(seed)
    width = rng.uniform(1e-4, 1.0, 3)
    difference = rng.normal(0.0, 1.0, 3) * rng.choice([0.1, 1.0, 10.0])
    price = np.append(0.0, rng.normal(0.0, 1.0, 2) * (rng.random(2) < 0.8))
    low, high = np.minimum(price, 0.0), np.maximum(price, 0.0)
    edge = _of_blocks(width[None], difference[None], low[None], high[None])
    after_low, after_high = np.append(low[1:], 0.0), np.append(high[1:], 0.0)
    share = funnel(difference - 0.5 * width, width, after_low, after_high, steps=30)
    found = 0.5 - (difference + edge - np.append(edge[1:], 0.0)) / width
    np.testing.assert_allclose(found, share, rtol=1e-6, atol=1e-6 / width.min())


@pytest.mark.parametrize("car", ["paper-liion", "prius-nimh"])
def test_near_arrival_prices_fall_that_nothing_asks_for_any_more(car):
    """Heat and charge are provided for, and the prices of a minute ago are those of empty stages.

    A walk over these that was cut short came to none that moves: after 60 rounds -0.49 g of -0.14.
    """
    trip = Trip("nycc", load_vehicle(car))
    controller = MhCostate(trip)
    stages = controller.preview.at(trip.steps - 4)
    n = len(stages.duration_s)
    soc, t_cl_degc = trip.vehicle.trip.soc_init + 1e-3, 40.215
    about = Linearisation.constant(n, t_cl_degc)
    p = controller.programs.at(stages, soc, t_cl_degc, about, False)
    heat = np.zeros(n)
    heat[[0, -3, -2]] = 0.01, 0.14, 2.87
    start = Multipliers(np.full(n, 62.6), heat)
    p = smoothed(p, start)
    few, many = (newton(p, start, rounds, MOST).value for rounds in (10, 100))
    assert few == pytest.approx(many, abs=1e-3)
    assert many > dual(p, start).value + 0.3
