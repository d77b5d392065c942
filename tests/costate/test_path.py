"""The shortest path, and the choices of a block, against every choice tried."""

from itertools import pairwise, product
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.costate.path import Shortest, blocks_least, shortest_path

COSTS = st.floats(-1.0, 1.0)


def allowed(runs, is_on, for_s, shortest, arrives):
    """Whether each run and rest that begins or ends here is long enough."""
    length, on = for_s, is_on
    for k, now in enumerate(runs):
        if now == on:
            length += 1
            continue
        if length < (shortest.on_s if on else shortest.off_s):
            return False
        if now and arrives and len(runs) - k < shortest.on_s:
            return False
        on, length = now, 1
    return True


@given(
    st.integers(1, 8).flatmap(
        lambda n: st.lists(st.tuples(COSTS, COSTS, COSTS), min_size=n, max_size=n)
    ),
    st.integers(1, 4),
    st.integers(1, 3),
    st.booleans(),
    st.integers(1, 5),
    st.booleans(),
)
def test_no_choice_costs_less(costs, on_s, off_s, is_on, for_s, arrives):
    on, off, start = map(list, zip(*costs, strict=True))
    shortest = Shortest(on_s, off_s)
    found = shortest_path(on, off, start, shortest, is_on, for_s, arrives)

    def cost(runs):
        total = 0.0
        for k, (before, now) in enumerate(pairwise([is_on, *runs])):
            total += (on[k] + (0.0 if before else start[k])) if now else off[k]
        return total

    tried = [
        cost(runs)
        for runs in product((False, True), repeat=len(on))
        if allowed(runs, is_on, for_s, shortest, arrives)
    ]
    assert allowed(found.runs, is_on, for_s, shortest, arrives)
    assert found.cost == pytest.approx(min(tried), abs=1e-12)
    assert cost(found.runs) == pytest.approx(found.cost, abs=1e-12)


def test_what_must_be_breaks_a_rest():
    """The battery alone cannot drive the second that begins half a rest after a stop."""
    found = shortest_path([1.0, 1.0], [inf, 0.0], [1.0, 1.0], Shortest(1, 4), False, 1, False)
    assert found.runs[0]


@given(
    st.lists(st.tuples(COSTS, COSTS, COSTS, st.floats(0.0, 3.0)), min_size=3, max_size=3),
    st.floats(0.0, 1.0),
)
def test_a_block_is_the_best_of_its_choices(stages, entry):
    """And no dearer than that where it is entered, though a start paid by its heat."""
    on, off, start, rises = (np.array(values) for values in zip(*stages, strict=True))
    rises = -rises
    rises[0] = 0.0
    tried, entered = [], []
    for runs in product((0, 1), repeat=3):
        cost = sum(a if r else b for r, a, b in zip(runs, on, off, strict=True))
        for k in (1, 2):
            cost += start[k] * max(rises[k] * (runs[k] - runs[k - 1]), 0.0)
        tried.append(cost)
        entered += [cost + start[0] * entry * max(runs[0] - before, 0) for before in (0, 1)]
    both = [np.tile(values, 2) for values in (on, off, start, rises)]
    assert blocks_least(*both, 3) == pytest.approx(2.0 * min(tried), abs=1e-12)
    assert blocks_least(on[:0], off[:0], start[:0], rises[:0], 3) == 0.0
    coupled = np.append(entry, rises[1:])
    assert blocks_least(on, off, start, coupled, 3) <= min(entered) + 1e-12
