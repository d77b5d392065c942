"""A running sum kept within limits at least cost: the prices of its terms, in one walk.

The charge of the battery, the heat of the coolant and the starts of the engine are all of this
form; see docs/costate.md.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_RESPONSE = 1e-300  # below it a limit cannot be met by any price
TIE = 1e-12  # relative


def funnel(
    offset: Floats, response: Floats, low: Floats, high: Floats, start: float, target: float = 0.0
) -> Floats:
    """Return the price of each term of a running sum.

    The terms are offset_k + response_k p_k, those of

        min  sum_k 1/2 response_k (p_k - target)^2   subject to   low_k <= x_k <= high_k,
        x_k = x_{k-1} + offset_k + response_k p_k,   x_0 = start.

    A price is the same from term to term, and `target` after the last, but falls where the sum is
    at a lower limit and rises where it is at an upper one. So along a stretch of one price every
    limit is an interval of prices. Walked forward, the interval [L, U] that meets all limits so far
    is kept; where a new limit empties it, the stretch ends at the limit that made U (or L), which
    fixes its price, and the walk starts again from there. A limit that no price can move is passed
    over.

    Parameters
    ----------
    offset, response, low, high : shape (n,); response >= 0, low <= high
    start, target : as above

    Returns
    -------
    p, shape (n,)
    """
    count = len(offset)
    price = np.empty(count)
    first, here = 0, start
    while first < count:
        at_zero = here + np.cumsum(offset[first:])
        moves = np.cumsum(response[first:])
        movable = moves > LEAST_RESPONSE
        per = np.where(movable, moves, 1.0)
        least = np.where(movable, (low[first:] - at_zero) / per, -np.inf)
        most = np.where(movable, (high[first:] - at_zero) / per, np.inf)
        low_price = np.maximum.accumulate(least)
        high_price = np.minimum.accumulate(most)
        gap = low_price - high_price
        empty = np.flatnonzero(gap > TIE * np.maximum(np.abs(low_price), np.abs(high_price)))
        if len(empty):
            at = int(empty[0])
            from_low = bool(most[at] < low_price[at])
            p = low_price[at - 1] if from_low else high_price[at - 1]
            upto = at
        else:
            upto = count - first
            p = min(max(target, low_price[-1]), max(high_price[-1], low_price[-1]))
            if p == target:
                price[first:] = p
                break
            from_low = p > target
        reached = (least if from_low else most)[:upto]
        contact = upto - 1 - int(reached[::-1].argmax() if from_low else reached[::-1].argmin())
        price[first : first + contact + 1] = p
        here = float((low if from_low else high)[first + contact])
        first += contact + 1
    return price
