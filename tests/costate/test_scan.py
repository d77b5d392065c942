"""The scan against a QP solver that knows nothing of running sums."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from qpsolvers import solve_qp

from qpmpc.costate.scan import scan


@st.composite
def problems(draw):
    """Terms, and limits of one kind about the path that some prices lead to; some have none."""
    n = draw(st.integers(1, 12))

    def numbers(low, high):
        return np.array(draw(st.lists(st.floats(low, high), min_size=n, max_size=n)))

    offset, response, decay = numbers(-1.0, 1.0), numbers(0.05, 2.0), numbers(0.3, 1.0)
    kind = draw(st.sampled_from([1.0, -1.0]))
    path = sums(decay) @ (offset + response * numbers(-2.0, 2.0))
    side = np.where(numbers(0.0, 1.0) > 0.7, 0.0, kind)
    return offset, response, path - kind * numbers(0.0, 2.0), side, decay


def sums(decay):
    """x of unit terms, shape (n, n)."""
    n = len(decay)
    return np.array(
        [[np.prod(decay[j + 1 : k + 1]) * (j <= k) for j in range(n)] for k in range(n)]
    )


def prices(multipliers, decay):
    """p of each term: backwards, p_k = m_k + d_{k+1} p_{k+1}."""
    price, found = 0.0, []
    for own, on in zip(multipliers[::-1], decay[::-1], strict=True):
        price += own
        found.append(price)
        price *= on
    return np.array(found[::-1])


@settings(deadline=None, max_examples=200)
@given(problems())
@example((np.array([0.5]), np.array([0.0546875]), np.array([0.49999945]), -np.ones(1), np.ones(1)))
def test_multipliers_are_those_of_the_qp(problem):
    offset, response, limit, side, decay = problem
    found = scan(offset, response, limit, side, decay)
    assert (side * found >= 0.0).all()
    assert (found[side == 0.0] == 0.0).all()
    of = sums(decay)
    price = prices(found, decay)
    x = of @ (offset + response * price)
    assert (side * (x - limit) >= -1e-9).all()
    met = found != 0.0
    np.testing.assert_allclose(x[met], limit[met], atol=1e-9)
    exact = solve_qp(
        np.diag(response),
        np.zeros_like(response),
        -side[:, None] * of * response,
        -side * (limit - of @ offset),
        solver="daqp",
        primal_tol=1e-10,  # a price may be off by that over the response, 0.05 at least
    )
    assert exact is not None
    np.testing.assert_allclose(price, exact, atol=1e-5)


@settings(deadline=None, max_examples=100)
@given(problems(), st.integers(1, 3))
def test_terms_that_no_price_moves_change_nothing(problem, times):
    """As the empty stages of a block, whose x is that of the stage before."""
    offset, response, limit, side, decay = problem
    again = np.repeat(np.arange(len(offset)), times)
    own = np.append(True, np.diff(again) > 0)
    found = scan(
        np.where(own, offset[again], 0.0),
        np.where(own, response[again], 0.0),
        limit[again],
        np.where(own, side[again], 0.0),
        np.where(own, decay[again], 1.0),
    )
    once = scan(offset, response, limit, side, decay)
    np.testing.assert_array_equal(found[own], once)
    assert (found[~own] == 0.0).all()


def test_a_price_falls_over_a_lower_limit_and_rises_over_an_upper_one():
    limit, side = np.array([0.0, 2.0, 1.0, 0.0]), np.array([0.0, 1.0, -1.0, 0.0])
    found = scan(np.zeros(4), np.ones(4), limit, side, np.ones(4))
    assert found == pytest.approx([0.0, 2.0, -1.0, 0.0])
