"""Rounds of Newton on the dual, each with all limits solved exactly by two funnels."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.dual import Dual, Multipliers, dual, with_signs
from qpmpc.costate.funnel import funnel
from qpmpc.costate.program import Program

Floats = NDArray[np.float64]

SWEEPS = 2  # of SOC and coolant in a round
BACKGROUND = 0.05  # share of a switch's curvature that a stage has that does not respond now
SOFTENED = 10  # sets of limits that may be given up in a sweep, because their slack is cheaper
MODERATE = 0.15  # of the engine's power
LEAST_DECAY = 0.02  # of the coolant over a stage, in the search alone
SHARES = (1.0, 0.4, 0.1, 0.02)  # of the way to the aim that are tried, and if the first is good
BEYOND = 4.0


def newton(
    program: Program,
    start: Multipliers,
    rounds: int,
    most_charge: float,
    on_round: Callable[[Dual], None] | None = None,
) -> Dual:
    """Return the dual after some rounds.

    A round aims at the solution of the linearised problem and goes there as far as the dual's
    value, which is a lower bound on the program, rises: no step size has to be chosen.

    Parameters
    ----------
    program : of the second
    start : multipliers to begin at
    rounds : number of rounds, with up to `len(SHARES)` evaluations each
    most_charge : largest lambda allowed, g
    on_round : called with the dual before each round
    """
    here = dual(program, start)
    for _ in range(rounds):
        if on_round is not None:
            on_round(here)
        there = _ahead(program, here, aim(program, here, most_charge))
        if there is None:
            break
        here = there
    return here


def _ahead(program: Program, here: Dual, goal: Multipliers) -> Dual | None:
    """Return the dual on the way to the aim, or beyond it, where it is higher; None if nowhere."""
    for share in SHARES:
        there = dual(program, here.at.towards(goal, share))
        if there.value > here.value:
            break
    else:
        return None
    if share == SHARES[0]:
        beyond = here.at.towards(goal, BEYOND)
        further = dual(program, with_signs(beyond, program.slack_g_per_k))
        if further.value > there.value:
            return further
    return there


def aim(program: Program, here: Dual, most_charge: float) -> Multipliers:
    """Solve the problem linearised at a point, by sweeps of SOC and coolant."""
    p, at = program, here.at
    # of a stage that does not respond now: of switching an engine at a moderate power
    moderate_w = MODERATE * p.curves.end_w[-1:]
    fuel = p.curves.fuel_g_per_s(moderate_w)
    background = BACKGROUND / here.width
    of_charge = here.charge_curvature + background * (p.charge_per_w * moderate_w) ** 2
    warms = p.per_fuel * fuel - p.per_power * moderate_w
    of_heat = here.heat_curvature + background * warms**2
    charge, heat = at.charge, at.heat
    change = np.diff(here.soc, prepend=p.soc)
    moved = np.zeros_like(change)  # of nu
    coolant = _Coolant(p, here)
    for _ in range(SWEEPS):
        offset = change - of_charge * at.charge + here.cross_curvature * moved
        charge = funnel(offset, of_charge, p.soc_low, p.soc_high, p.soc)
        charge = np.clip(charge, 0.0, most_charge)
        heat = coolant.heat(of_heat, here.cross_curvature * (charge - at.charge))
        moved = coolant.moved(heat - at.heat)
    return Multipliers(charge, heat)


class _Coolant:
    """The coolant as a running sum x = T / phi, with phi the product of the decays.

    In it the price M = nu t_end phi is the same from stage to stage, but for a known part of
    `price_t` and where a limit binds.
    """

    def __init__(self, program: Program, here: Dual) -> None:
        self._p = p = program
        decay = np.maximum(-p.t_before / p.t_end, LEAST_DECAY)
        self._phi = phi = np.cumprod(decay)
        self._per = 1.0 / (p.t_end * phi)
        x = here.t_cl_degc / phi
        self._start = p.t_cl_degc
        self._change = np.diff(x, prepend=p.t_cl_degc)
        self._price = np.cumsum((phi * here.at.heat)[::-1])[::-1]
        self._low, self._high = p.t_low / phi, p.t_high / phi

    def heat(self, of_heat: Floats, more: Floats) -> Floats:
        """Multipliers of the limits, given a stage's response and its further heat.

        A limit whose multiplier would be more than the price of its slack gets that price, and is
        a limit no more.
        """
        slack = self._p.slack_g_per_k
        response = of_heat * self._per**2
        offset = self._change + more * self._per - response * self._price
        low, high = self._low.copy(), self._high.copy()
        given = np.zeros_like(offset)
        for _ in range(SOFTENED):
            base = np.cumsum((self._phi * given)[::-1])[::-1]
            price = funnel(offset + response * base, response, low, high, self._start)
            jump = (price - np.append(price[1:], 0.0)) / self._phi
            over = (np.abs(jump) > slack) & (given == 0.0)
            if not over.any():
                break
            given[over] = np.sign(jump[over]) * slack
            low[over], high[over] = -np.inf, np.inf
        found: Floats = np.clip(jump + given, -slack, slack)
        return found

    def moved(self, heat: Floats) -> Floats:
        """How nu moves with the multipliers."""
        p, after, found = self._p, 0.0, []
        before = [*p.t_before[1:].tolist(), 0.0]
        ends, steps = p.t_end.tolist(), heat.tolist()
        for k in range(len(steps) - 1, -1, -1):
            after = (steps[k] - before[k] * after) / ends[k]
            found.append(after)
        return np.array(found[::-1])
