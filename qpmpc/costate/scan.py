"""A running sum that decays, each term with one limit, kept within them at least cost: one scan.

The heat of the coolant is of this form: a warm engine is near its upper limit or its lower one,
never both. The generated C takes the same steps in the same order (`mpc_costate_scan.c`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.funnel import ENDLESS_RESPONSE, LEAST_RESPONSE

Floats = NDArray[np.float64]


def scan(offset: Floats, response: Floats, limit: Floats, side: Floats, decay: Floats) -> Floats:
    """Return the multipliers of the limits of a running sum.

    With the terms offset_k + response_k p_k, those of

        min  sum_k 1/2 response_k p_k^2   subject to   side_k x_k >= side_k limit_k,
        x_k = d_k x_{k-1} + offset_k + response_k p_k,   x before the first = 0.

    The price d_k p_k = p_{k-1} goes on from term to term, and is 0 after the last, but changes at a
    limit that is met, by its multiplier m_k = p_k - d_{k+1} p_{k+1}: above 0 at a lower limit,
    below at an upper one. Each term comes once. Its limit is taken to be met, by one price since
    the last that is; where that leaves the last one a multiplier of the wrong sign, that is not
    met, and the two stretches are one. A limit goes at most once, so 2 n + 1 steps suffice.

    Where all limits are of one kind this is the solution (x over the sum of responses is then the
    least concave curve above them, or the greatest convex one below). Where they are not, a limit
    that has gone may be exceeded because one of the other kind goes later.

    Parameters
    ----------
    offset, response, limit, decay : shape (n,); response >= 0, decay > 0
    side : 1 for a lower limit, -1 for an upper one, 0 for none, which it has to be before the first
        term that responds; shape (n,)

    Returns
    -------
    m, shape (n,)
    """
    none = Stretch(-1, 0.0, 0.0, 1.0, 0.0, 0.0)
    terms = zip(
        range(len(offset) + 1),
        [*offset.tolist(), 0.0],
        [*response.tolist(), ENDLESS_RESPONSE],
        [*decay.tolist(), 1.0],
        [*limit.tolist(), 0.0],
        [*side.tolist(), 1.0],
        strict=True,
    )
    met, found = [none], np.zeros(len(offset) + 1)
    now = none
    for term in terms:
        now = now.joined(Stretch(*term))
        if now.side == 0.0:
            continue
        while True:
            last = met[-1]
            misses = now.limit - now.decay * last.limit - now.offset
            price = misses / max(now.response, LEAST_RESPONSE)
            jump = last.price - now.decay * price
            if not last.side * jump < 0.0:  # as in C, also where a number is none
                break
            now = met.pop().joined(now)
            found[last.at] = 0.0
        found[last.at] = jump
        met.append(now._replace(price=price))
        now = none
    return found[:-1]


class Stretch(NamedTuple):
    """Terms with one price, up to one whose limit is met.

    Attributes
    ----------
    at : its last term
    offset, response, decay : x at its end is offset + decay x before + response price
    limit, side : of the last term
    price : at its end
    """

    at: int
    offset: float
    response: float
    decay: float
    limit: float
    side: float
    price: float = 0.0

    def joined(self, after: "Stretch") -> "Stretch":
        """Return this stretch and the next as one."""
        return after._replace(
            offset=self.offset * after.decay + after.offset,
            response=self.response * after.decay * after.decay + after.response,
            decay=self.decay * after.decay,
        )
