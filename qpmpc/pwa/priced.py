"""The running engine at given prices: the least of a second or stage, and how it responds to them.

The same in C: codegen/runtime/mpc_priced.h.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.pwa.curves import Curves

Floats = NDArray[np.float64]

LEAST_RATIO = 1e-3  # of prices: below it charging is for nothing
LEAST_PRICE = 1e-30  # of the battery's store, g/W: of a masked stage


class Least(NamedTuple):
    """Least-cost engine power of each stage with the engine on, shape (n,) each.

    Attributes
    ----------
    power_w : E
    fuel_g_per_s, internal_w : f(E), l(P0 - E)
    cost : w_F f + w_E E + w_G l, in the unit of the prices
    slope_g_per_j : of the piece of f that E lies on
    ratio : r, slope of l there where E is inside a piece and its limits
    gives : dE of a unit of marginal cost, W^2 per unit of cost; 0 at a kink or a limit
    """

    power_w: Floats
    fuel_g_per_s: Floats
    internal_w: Floats
    cost: Floats
    slope_g_per_j: Floats
    ratio: Floats
    gives: Floats


class StagePrices(NamedTuple):
    """What the rates of each stage cost, shape (n,) each: w_F, w_E and w_G >= 0."""

    fuel: Floats
    power: Floats
    internal: Floats


class Going(NamedTuple):
    """Seconds with the engine on, at their least-cost power, against the same with it off.

    Shape (N,) each.

    Attributes
    ----------
    power_w : E
    gain_w : g = l(P0) - l(P0 - E), what the battery's store gains by it
    dearer_g_per_s : d = w_F f(E) + w_E E - w_G g, what it costs more at the plan's prices; by those
        of the second itself nothing behind arrival
    """

    power_w: Floats
    gain_w: Floats
    dearer_g_per_s: Floats


def going(on: Least, off_w: Floats, at: StagePrices) -> Going:
    """Return seconds with the engine on against l(P0), the internal power with it off."""
    gain_w = off_w - on.internal_w
    spent = at.fuel * on.fuel_g_per_s + at.power * on.power_w
    return Going(on.power_w, gain_w, spent - at.internal * gain_w)


class _Pieces(NamedTuple):
    """Each piece of f as if it went on for ever, shape (n, pieces) each: E_i, r_i, dE_i."""

    power_w: Floats
    ratio: Floats
    gives: Floats


def least(curves: Curves, net_w: Floats, low_w: Floats, high_w: Floats, at: StagePrices) -> Least:
    """Minimise  w_F f(E) + w_E E + w_G l(P0 - E)  over low <= E <= high, exactly.

    On piece i of f the slope of l has to be r_i = (w_F a_i + w_E) / w_G, at the battery power

        P_i = U^2 (1 - 1 / r_i^2) / (4 R),  R of discharge for r_i > 1, else of charge

    so that E_i = P0 - P_i, clipped to the piece and the limits; the least of all pieces is the
    least of the stage, whatever the shape of f, because l is convex. The last piece goes on.

    Parameters
    ----------
    curves : f and l
    net_w : P0, shape (n,)
    low_w, high_w : limits of E, low <= high, shape (n,)
    at : prices
    """
    each = _on_each_piece(curves, net_w, at)
    free = each.power_w
    begin = np.maximum(curves.begin_w, low_w[:, None])
    end = np.minimum(np.append(curves.end_w[:-1], np.inf), high_w[:, None])
    power = np.minimum(np.maximum(free, begin), end)
    internal = curves.internal_w(net_w[:, None] - power)
    fuel = curves.slope * power + curves.intercept
    cost = at.fuel[:, None] * fuel + at.power[:, None] * power
    cost += at.internal[:, None] * internal
    cost = np.where(begin <= end, cost, np.inf)
    best = (np.arange(len(net_w)), cost.argmin(axis=1))
    inside = (free > begin) & (free < end)
    return Least(
        power[best],
        fuel[best],
        internal[best],
        cost[best],
        curves.slope[best[1]],
        each.ratio[best],
        np.where(inside, each.gives, 0.0)[best],
    )


def least_convex(
    curves: Curves, net_w: Floats, low_w: Floats, high_w: Floats, at: StagePrices
) -> Least:
    """Minimise as `least` does, for a convex f: there is one piece that the least lies on.

    It is the first one whose E_i, within the limits, does not lie beyond its end. Parameters as of
    `least`.
    """
    each = _on_each_piece(curves, net_w, at)
    free = each.power_w
    kept = np.minimum(np.maximum(free[:, :-1], low_w[:, None]), high_w[:, None])
    is_beyond = kept > curves.end_w[:-1]
    best = (np.arange(len(net_w)), is_beyond.cumprod(axis=1).sum(axis=1))
    own, begin = free[best], curves.begin_w[best[1]]
    power = np.minimum(np.maximum(np.maximum(own, begin), low_w), high_w)
    inside = (own > np.maximum(begin, low_w)) & (own < high_w)
    gives = np.where(inside, each.gives[best], 0.0)
    slope = curves.slope[best[1]]
    fuel = slope * power + curves.intercept[best[1]]
    internal = curves.internal_w(net_w - power)
    cost = at.fuel * fuel + at.power * power + at.internal * internal
    return Least(power, fuel, internal, cost, slope, each.ratio[best], gives)


def _on_each_piece(curves: Curves, net_w: Floats, at: StagePrices) -> _Pieces:
    """Return where the slope of l is r_i, on each piece; parameters as of `least`."""
    w_internal = np.maximum(at.internal, LEAST_PRICE)[:, None]
    ratio = (at.fuel[:, None] * curves.slope + at.power[:, None]) / w_internal
    ratio = np.maximum(ratio, LEAST_RATIO)
    quarter_w = curves.square_v2 / (
        4.0 * np.where(ratio > 1.0, curves.discharge_ohm, curves.charge_ohm)
    )
    power_w = net_w[:, None] - quarter_w * (1.0 - 1.0 / ratio**2)
    return _Pieces(power_w, ratio, 2.0 * quarter_w / (ratio**3 * w_internal))
