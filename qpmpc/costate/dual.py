"""The smoothed dual of the stage program: its value, slopes and curvature at given multipliers."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.funnel import funnel
from qpmpc.costate.program import LEAST_SWITCH_G, LEAST_WORTH, Program, moderate
from qpmpc.pwa.curves import Curves
from qpmpc.pwa.priced import Least, StagePrices, least, least_convex

Floats = NDArray[np.float64]

START_QUARTER_STEPS = 12  # of the funnel, a quarter of those a stage has

EDGE = 1e-6  # of sigma (1 - sigma): as near to 0 or 1 a share may be there, but for rounding


@dataclass(frozen=True)
class Multipliers:
    """Prices of the limits; the costates follow from them.

    Attributes
    ----------
    charge : lambda, g per unit of SOC at the end of each stage, >= 0; it falls over a lower limit
        that binds and rises over an upper one, by the limit's multiplier
    heat : multipliers of the coolant limits, g/K: of the lower one above 0, of the upper below
    """

    charge: Floats
    heat: Floats

    def towards(self, other: "Multipliers", share: float) -> "Multipliers":
        """Return the point that far on the way to another.

        A multiplier of the coolant ends at 0 where it would change its sign: beyond, it is that of
        the other limit, of which the way knows nothing.
        """
        heat = self.heat + share * (other.heat - self.heat)
        return Multipliers(
            self.charge + share * (other.charge - self.charge),
            np.where(self.heat * heat < 0.0, 0.0, heat),
        )


def with_signs(at: Multipliers, slack_g_per_k: float) -> Multipliers:
    """Return multipliers of the right sign from any: lambda >= 0, heat within the slack's price."""
    return Multipliers(np.maximum(at.charge, 0.0), np.clip(at.heat, -slack_g_per_k, slack_g_per_k))


def coolant_costate(program: Program, heat: Floats) -> Floats:
    """Return nu, the price of the coolant row, g/K, shape (n,).

    Backwards, nu_k = -(price_t_k + t_before_k+1 nu_k+1 - heat_k) / t_end_k.

    It has to come from here: any other leaves T_k, which has no bound, a price.
    """
    price, after = [], 0.0
    drive = (heat - program.price_t).tolist()
    t_end = program.t_end.tolist()
    before = [*program.t_before[1:].tolist(), 0.0]
    for k in range(len(drive) - 1, -1, -1):
        after = (drive[k] - before[k] * after) / t_end[k]
        price.append(after)
    return np.array(price[::-1])


def stage_prices(program: Program, at: Multipliers, nu: Floats) -> StagePrices:
    """Return what the rates of each stage cost: w_F, w_E and w_G."""
    p = program
    charge = at.charge * p.charge_per_w
    return StagePrices(p.fuel_cost - nu * p.per_fuel, nu * p.per_power, charge)


@dataclass(frozen=True)
class StageCosts:
    """Every stage minimised at costates lambda and nu.

    Attributes
    ----------
    nu : costate of the coolant
    on : the stage with its engine on, in the seconds with a choice
    forced : in the others, where a longer stage has both
    forced_cost : of these, g
    on_cost, off_cost : of all seconds with a choice, g; infinite where it may not or must be on
    start_cost : of one start, g
    """

    nu: Floats
    on: Least
    forced: Least
    forced_cost: Floats
    on_cost: Floats
    off_cost: Floats
    start_cost: Floats

    def with_first(self, count: int, exact: "StageCosts") -> "StageCosts":
        """Return the same with the first stages of another."""

        def joined(one: Floats, other: Floats) -> Floats:
            return np.concatenate([one[:count], other[count:]])

        return StageCosts(
            self.nu,
            Least(*map(joined, exact.on, self.on)),
            self.forced,
            self.forced_cost,
            joined(exact.on_cost, self.on_cost),
            self.off_cost,
            self.start_cost,
        )

    @classmethod
    def of(cls, program: Program, at: Multipliers, curves: Curves) -> "StageCosts":
        """Evaluate all stages on these curves."""
        p = program
        nu = coolant_costate(p, at.heat)
        minimised = least_convex if curves is p.shared else least
        prices = stage_prices(p, at, nu)
        on = minimised(curves, p.net_w, p.low_w, p.high_w, prices)
        forced = minimised(curves, p.forced_net_w, p.forced_low_w, p.forced_high_w, prices)
        start = p.start_fuel_g + at.charge * p.cranking_soc - nu * p.start_k
        off = p.free * prices.internal * p.off_w
        return cls(
            nu,
            on,
            forced,
            p.forced * forced.cost,
            np.where(p.can, p.free * on.cost, np.inf),
            np.where(p.must, np.inf, off),
            start,
        )


@dataclass(frozen=True)
class Dual:
    """The smoothed dual at some multipliers; see `dual`.

    Attributes
    ----------
    at : the multipliers
    value : a lower bound on the program, g; but where a start's heat is worth more than the start,
        as beyond a coolant limit, starts count as free, and it is a measure for the search alone
    costs : of the stages
    share : sigma
    starts : u
    soc, t_cl_degc : what the stages lead to
    change, heat : of SOC and of the coolant row by each stage, starts included
    charge_curvature, cross_curvature, heat_curvature : derivatives of `change` with respect to
        lambda, of `change` to nu, of `heat` to nu
    """

    at: Multipliers
    value: float
    costs: StageCosts
    share: Floats
    starts: Floats
    soc: Floats
    t_cl_degc: Floats
    charge_curvature: Floats
    cross_curvature: Floats
    heat_curvature: Floats


def smoothed(program: Program, at: Multipliers) -> Program:
    """Return a program with the W of each stage by what a search begins with.

    The seconds of a stage differ by what they ask of the battery, P0, and so do their costs of on
    against off: by lambda (l'(P0 - E) - l'(P0)) a watt, which is lambda times a power E of the
    engine, as losses are nearly quadratic. Where heat makes a charge cheap, and where the engine
    idles for heat, the seconds are alike:

        W = h s min(max(lambda E / (lambda_usual E_moderate), `LEAST_WORTH`), 1)

    with s of a second or of a longer stage, where starts cost something or nothing, and E at these
    prices.

    Parameters
    ----------
    program : of the second
    at : multipliers of the limits
    """
    p = program
    power_w = StageCosts.of(p, at, p.shared).on.power_w
    usual_w = p.usual_charge_g * moderate(p.curves)[0]
    worth = np.clip(at.charge * power_w / usual_w, LEAST_WORTH, 1.0)
    return replace(p, width=np.maximum(p.widest * worth, LEAST_SWITCH_G))


def constant_part(program: Program, at: Multipliers, nu: Floats) -> float:
    """Terms of the rows and limits in the Lagrangian that no variable of a stage is in, g."""
    p = program
    jump = at.charge - np.append(at.charge[1:], 0.0)
    limits = np.where(jump > 0.0, jump * p.soc_low, jump * p.soc_high).sum()
    heat = np.where(at.heat > 0.0, at.heat * p.t_low, at.heat * p.t_high).sum()
    rows = float(nu[0] * p.t_before[0] * p.t_cl_degc - (nu * p.settled).sum())
    return float(limits + heat) + rows - float(at.charge[0]) * p.soc


def dual(program: Program, at: Multipliers) -> Dual:
    """Evaluate the smoothed dual.

    In each stage sigma J_on + (1 - sigma) J_off + W / 2 (sigma^2 - sigma) is minimised over sigma
    in [0, 1], with W the cost over which the switch is smoothed: no more than the stage's own
    least, and at most W / 8 below it; what the seconds without a choice cost is beside it. Starts
    couple the stages of a chain by prices e_k of sigma_k - sigma_k-1 between 0 and rises_k times
    the cost of a start; that is a funnel too.
    """
    p, costs, width = program, StageCosts.of(program, at, program.shared), program.width
    free = p.can & ~p.must
    difference = np.where(free, costs.on_cost, 0.0) - np.where(free, costs.off_cost, 0.0)
    starts_g, starts = np.zeros_like(width), np.zeros_like(width)
    if p.has_start:
        start_price = np.maximum(costs.start_cost, 0.0) * p.rises
        # beyond it no start is worth it: as good as must or must not, and as no larger difference
        decided = width + np.abs(start_price) + np.abs(np.append(start_price[1:], 0.0))
        difference = np.where(free, np.clip(difference, -decided, decided), difference)
        difference = np.where(free, difference, np.where(p.must, -decided, decided))
        edge = _start_prices(p, width, difference, start_price)
        starts_g = edge - np.append(edge[1:], 0.0)
    share = np.clip(0.5 - (difference + starts_g) / width, 0.0, 1.0)
    share = np.where(free, share, np.where(p.must, 1.0, 0.0))
    if p.has_start:
        rise = np.diff(share, prepend=float(p.starts_on))
        starts = np.maximum(p.rises * rise, 0.0)
    on_part = share * np.where(p.can, costs.on_cost, 0.0)
    off_part = (1.0 - share) * np.where(p.must, 0.0, costs.off_cost)
    stages_g = on_part + off_part + share * starts_g + 0.5 * width * (share**2 - share)
    stages_g += costs.forced_cost
    value = float(stages_g.sum()) + constant_part(p, at, costs.nu)
    on, forced = costs.on, costs.forced
    parts = ((on, p.free * share * on.gives), (forced, p.forced * forced.gives))
    of_charge, cross, of_heat = np.zeros((3, len(share)))
    for part, gives in parts:
        v_charge = p.charge_per_w * part.ratio
        v_heat = p.per_fuel * part.slope_g_per_j - p.per_power
        of_charge += gives * v_charge**2
        cross += gives * v_charge * v_heat
        of_heat += gives * v_heat**2
    switch_charge = p.free * p.charge_per_w * (p.off_w - on.internal_w)
    switch_heat = p.free * (p.per_fuel * on.fuel_g_per_s - p.per_power * on.power_w)
    turns = np.where(free & (share * (1.0 - share) > EDGE), 1.0 / width, 0.0)
    spent_w = p.free * p.off_w + p.forced * forced.internal_w
    change = share * switch_charge - p.charge_per_w * spent_w - p.cranking_soc * starts
    of_forced = p.per_fuel * forced.fuel_g_per_s - p.per_power * forced.power_w
    heat = share * switch_heat + p.forced * of_forced + p.start_k * starts
    return Dual(
        at,
        value,
        costs,
        share,
        starts,
        p.soc + np.cumsum(change),
        coolant(p, heat),
        of_charge + turns * switch_charge**2,
        cross + turns * switch_charge * switch_heat,
        of_heat + turns * switch_heat**2,
    )


def _start_prices(program: Program, width: Floats, difference: Floats, price: Floats) -> Floats:
    """Prices e_k of sigma_k - sigma_k-1, shape (n,), each between 0 and `price`.

    sigma_k = 1/2 - (J_on - J_off + e_k - e_k+1) / W_k. The seconds ahead are a chain, and so are
    the stages of a block; nothing joins these.
    """
    short, low, high = program.short, np.minimum(price, 0.0), np.maximum(price, 0.0)
    ahead = _chain(width[:short], difference[:short], low[:short], high[:short], program.starts_on)
    if program.classes == 1:
        return np.append(ahead, np.zeros(len(width) - short))
    longer = (values[short:].reshape(-1, 3) for values in (width, difference, low, high))
    return np.append(ahead, _of_blocks(*longer))


def _chain(width: Floats, difference: Floats, low: Floats, high: Floats, on_now: bool) -> Floats:
    """Prices e_k of a chain: a funnel with W as response.

    e_k+1 is a running sum of J_on - J_off - W / 2 + W sigma, between its limits.
    """
    first = 0.0 if on_now else float(high[0])
    after_low, after_high = np.append(low[1:], 0.0), np.append(high[1:], 0.0)
    offset = difference - 0.5 * width
    offset[0] += first
    share = funnel(
        offset, width, after_low, after_high, steps=START_QUARTER_STEPS * len(width) // 4
    )
    edge, edges = 0.0, [first]
    terms = zip(offset, width * share, after_low, after_high, strict=True)
    for known, more, at_least, at_most in terms:
        edge = min(max(edge + known + more, at_least), at_most)
        edges.append(edge)
    return np.array(edges[:-1])


def _of_blocks(width: Floats, difference: Floats, low: Floats, high: Floats) -> Floats:
    """Prices e_k of blocks of three stages, in closed form; shape (blocks, 3) each, flat result.

    e_1 = clip((D_0 W_1 - D_1 W_0 + e_2 W_0) / (W_0 + W_1)) makes sigma_1 = sigma_0, as far as it
    may, with D = J_on - J_off. With it sigma_2 = sigma_1 for an e_2 that is the one of e_1 free,
    but no less than that of e_1 at its lower limit and no more than that at the upper.
    """
    w_0, w_1, w_2 = width.T
    d_0, d_1, d_2 = difference.T
    known = (d_0 * w_1 - d_1 * w_0) / (w_0 + w_1)
    follows = w_0 / (w_0 + w_1)
    right = d_1 * w_2 - d_2 * w_1
    at_low, at_high = ((right + one[:, 1] * w_2) / (w_1 + w_2) for one in (low, high))
    free = (right + known * w_2) / (w_1 + (1.0 - follows) * w_2)
    second = np.clip(np.clip(free, at_low, at_high), low[:, 2], high[:, 2])
    first = np.clip(known + follows * second, low[:, 1], high[:, 1])
    return np.column_stack([np.zeros_like(first), first, second]).ravel()


def coolant(program: Program, heat: Floats) -> Floats:
    """Return T at the end of each stage of a plan with these heats, shape (n,)."""
    p = program
    t_cl, found = p.t_cl_degc, []
    rows = zip((p.settled + heat).tolist(), p.t_before.tolist(), p.t_end.tolist(), strict=True)
    for right, before, end in rows:
        t_cl = (right - before * t_cl) / end
        found.append(t_cl)
    return np.array(found)
