"""The funnel against a QP solver that knows nothing of running sums."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from qpsolvers import solve_qp

from qpmpc.costate.funnel import funnel


@st.composite
def problems(draw):
    """Terms, and limits about the path that some prices lead to, so that there is a solution."""
    n = draw(st.integers(1, 12))

    def numbers(low, high):
        return np.array(draw(st.lists(st.floats(low, high), min_size=n, max_size=n)))

    offset, response = numbers(-1.0, 1.0), numbers(0.05, 2.0)
    path = np.cumsum(offset + response * numbers(-2.0, 2.0))
    room_below, room_above = numbers(0.0, 2.0), numbers(0.0, 2.0)
    is_free = numbers(0.0, 1.0) > 0.6
    low = np.where(is_free, -1e3, path - room_below)
    high = np.where(is_free, 1e3, path + room_above)
    return offset, response, low, high


@settings(deadline=None, max_examples=150)
@given(problems())
def test_prices_are_those_of_the_qp(problem):
    offset, response, low, high = problem
    price = funnel(offset, response, low, high, steps=1000)
    of = np.tril(np.ones((len(offset), len(offset))))
    x = of @ (offset + response * price)
    assert (x >= low - 1e-9).all()
    assert (x <= high + 1e-9).all()
    bias = of @ offset
    moves = of * response
    exact = solve_qp(
        np.diag(response),
        np.zeros_like(response),
        np.vstack([moves, -moves]),
        np.concatenate([high - bias, bias - low]),
        solver="daqp",
        primal_tol=1e-10,  # a price may be off by that over the response, 0.05 at least
    )
    assert exact is not None

    def cost(p):
        return 0.5 * (response * p**2).sum()

    # the solution is unique; its cost is known to the solver's tolerance
    assert cost(price) <= cost(exact) + 1e-6 * (1.0 + cost(exact))
    np.testing.assert_allclose(price, exact, atol=1e-5)


def test_a_price_falls_over_a_lower_limit_and_rises_over_an_upper_one():
    free = np.full(4, 10.0)
    low, high = -free, free.copy()
    low[1], high[2] = 2.0, 1.0
    price = funnel(np.zeros(4), np.ones(4), low, high, steps=12)
    assert price == pytest.approx([1.0, 1.0, -1.0, 0.0])


def test_a_limit_that_no_price_can_move_is_passed_over():
    low = np.array([1.0, 1.0])
    price = funnel(np.zeros(2), np.array([0.0, 1.0]), low, low + 1.0, steps=6)
    assert price == pytest.approx([1.0, 1.0])
