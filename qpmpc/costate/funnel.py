"""A running sum kept within limits at least cost: the prices of its terms, in one walk.

The charge of the battery and the starts of the engine are of this form; see docs/costate.md. The
generated C takes the same steps in the same order (`mpc_costate_funnel.c`), as many of them as are
allowed, always.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_RESPONSE = 1e-20  # below it a limit cannot be met by any price
UNLIMITED = 1e30  # a price beyond any
ENDLESS_RESPONSE = 1e20  # of a term after the last: its limit leaves the price 0 alone


def funnel(offset: Floats, response: Floats, low: Floats, high: Floats, *, steps: int) -> Floats:
    """Return the price of each term of a running sum.

    The terms are offset_k + response_k p_k, those of

        min  sum_k 1/2 response_k p_k^2   subject to   low_k <= x_k <= high_k,
        x_k = x_{k-1} + offset_k + response_k p_k,   x before the first = 0.

    The price p_k = p_{k-1} goes on from term to term, and is 0 after the last, but falls where the
    sum is at a lower limit and rises where it is at an upper one. So along a stretch of one price
    every limit is an interval of prices. Walked forward, the interval [L, U] that meets all limits
    so far is kept; where a new limit empties it, the stretch ends at the limit that made U (or L),
    which fixes its price, and the walk starts again from there. A limit that no price can move is
    passed over. The stretch ends at once where a limit leaves one price alone. Where the steps do
    not suffice the last stretch has the price that meets the limits seen.

    Parameters
    ----------
    offset, response, low, high : shape (n,); response >= 0, low <= high
    steps : of the walk; going back to where a stretch ends costs some

    Returns
    -------
    p, shape (n,)
    """
    # one term more, which leaves the price 0 alone: where that is met, the walk ends
    terms = zip(
        [*offset.tolist(), 0.0],
        [*response.tolist(), ENDLESS_RESPONSE],
        [*low.tolist(), 0.0],
        [*high.tolist(), 0.0],
        strict=True,
    )
    ends, price = _ends([Term(*term) for term in terms], steps)
    found = []
    for k in range(len(offset) - 1, -1, -1):
        price = ends.get(k, price)
        found.append(price)
    return np.array(found[::-1])


class Term(NamedTuple):
    """A term and its limits."""

    offset: float
    response: float
    low: float
    high: float


class Bound(NamedTuple):
    """A bound of a stretch's price, where it was made: the price there, and x."""

    at: int
    price: float
    x: float


NO_BOUND = Bound(0, 0.0, 0.0)


def _ends(terms: list[Term], steps: int) -> tuple[dict[int, float], float]:
    """Prices of the stretches, each at its last term, and that of the last if it does not end."""
    last = len(terms) - 1
    ends: dict[int, float] = {}
    k, x, moves = 0, 0.0, 0.0
    least, most = -UNLIMITED, UNLIMITED  # L, U at the price of the present term
    of_least = of_most = NO_BOUND
    for _ in range(steps):
        term = terms[k]
        x += term.offset
        moves += term.response
        can_move = moves > LEAST_RESPONSE
        per_move = 1.0 / max(moves, LEAST_RESPONSE)
        low = (term.low - x) * per_move if can_move else -UNLIMITED
        high = (term.high - x) * per_move if can_move else UNLIMITED
        is_low, is_high = low >= least, high <= most
        if is_low:
            least, of_least = low, Bound(k, low, term.low)
        if is_high:
            most, of_most = high, Bound(k, high, term.high)
        if least < most:
            k += 1
            continue
        # one bound has met the other: the stretch ends at the one that was there before
        end = of_most if is_low and not is_high else of_least
        ends[end.at] = end.price
        k, x, moves, least, most = end.at + 1, end.x, 0.0, -UNLIMITED, UNLIMITED
        if k > last:
            break
    return ends, max(least, min(most, 0.0))
