"""Rounds of Newton on the dual, each with all limits at once: by a funnel and by a scan."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.dual import Dual, Multipliers, dual, with_signs
from qpmpc.costate.funnel import LEAST_RESPONSE, funnel
from qpmpc.costate.program import Program, moderate
from qpmpc.costate.scan import scan

Floats = NDArray[np.float64]

CHARGE_QUARTER_STEPS = 11  # of SOC's funnel, a quarter of those a term has
LEAST_RISE_G = 1e-7  # of the dual: less is as good as none
BACKGROUND = 0.05  # share of a switch's curvature that a stage has that does not respond now
LEAST_DECAY = 0.02  # of the coolant over a stage, in the search alone
AT_SLACK = 0.999  # of the slack's price: from there on a coolant limit is given up
# Of the way to the aim: the part that is tried first, and what becomes of it where the dual rose
# there, or did not.
FIRST_SHARE, MOST_SHARE, GROWS, SHRINKS = 1.0, 16.0, 2.0, 0.25
STREAK = 3  # rounds in a row that have to rise before more than the whole way is tried
# What a round moves; after one that did not rise the next in this order.
BOTH, CHARGE, HEAT = range(3)


def newton(
    program: Program,
    start: Multipliers,
    rounds: int,
    most_charge: float,
    on_round: Callable[[Dual], None] | None = None,
) -> Dual:
    """Return the dual after some rounds.

    A round aims at the solution of the linearised problem and tries one point on the way there, or
    beyond it: it goes there if the dual's value, which is a lower bound on the program, is higher.
    The next round tries the same part of its way or more, else less, and of the multipliers those
    of SOC alone, or of the coolant alone, in turn: where one switch has to keep both limits, the
    aim for one of them may be good and that for both not. So no step size has to be chosen, and
    every round is the same work.

    Parameters
    ----------
    program : of the second
    start : multipliers to begin at
    rounds : number of rounds, with one evaluation each
    most_charge : largest lambda allowed, g
    on_round : called with the dual before each round
    """
    here = dual(program, start)
    share, streak, moved = FIRST_SHARE, 0, BOTH
    for _ in range(rounds):
        if on_round is not None:
            on_round(here)
        goal = aim(program, here, most_charge, moved)
        there = dual(program, with_signs(here.at.towards(goal, share), program.slack_g_per_k))
        if there.value - here.value > LEAST_RISE_G:
            here, streak, moved = there, min(streak + 1, STREAK), BOTH
            if streak == STREAK or share < 1.0:
                share = min(GROWS * share, MOST_SHARE)
        else:
            streak, moved = 0, (moved + 1) % 3
            share = SHRINKS * min(share, 1.0)
    return here


def aim(program: Program, here: Dual, most_charge: float, moved: int = BOTH) -> Multipliers:
    """Solve the problem linearised at a point, first for SOC, then for the coolant.

    Or for one of them, with the multipliers of the other as they are.
    """
    p, at = program, here.at
    # of a stage that does not respond now: of switching an engine at a moderate power
    moderate_w, fuel = moderate(p.curves)
    background = BACKGROUND / p.widest
    of_charge = here.charge_curvature + background * (p.free * p.charge_per_w * moderate_w) ** 2
    warms = p.free * (p.per_fuel * fuel - p.per_power * moderate_w)
    of_heat = here.heat_curvature + background * warms**2
    # SOC is limited in each second and at the end of each block, so a block is one term
    first = np.append(np.arange(p.short), np.arange(p.short, len(of_charge), p.classes))
    last = np.append(first[1:], len(of_charge)) - 1
    low, high = (p.soc_low - here.soc)[last], (p.soc_high - here.soc)[last]
    response, offset = (np.add.reduceat(x, first) for x in (of_charge, -of_charge * at.charge))
    price = funnel(offset, response, low, high, steps=CHARGE_QUARTER_STEPS * len(first) // 4)
    charge = np.repeat(np.clip(price, 0.0, most_charge), last + 1 - first)
    if moved == HEAT:
        charge = at.charge
    return Multipliers(charge, at.heat if moved == CHARGE else _heat(p, here, of_heat, charge))


def _heat(program: Program, here: Dual, of_heat: Floats, charge: Floats) -> Floats:
    """Return multipliers of the coolant limits, given lambda.

    How much T_k moves is a running sum, with the decay of a stage. Its price is
    M_k = nu_k t_end_k, but for a known part of `price_t`. Of a stage's two limits the one that has
    a multiplier counts, else the nearer. A limit whose multiplier is the price of its slack, and is
    not kept all the same, is a limit no more; nor is that of a stage that gives no heat, which is
    empty, or shares the limit of the one before.
    """
    p, slack, heat = program, program.slack_g_per_k, here.at.heat
    decay = np.maximum(-p.t_before / p.t_end, LEAST_DECAY)
    low, high = p.t_low - here.t_cl_degc, p.t_high - here.t_cl_degc
    too_cold = (heat >= AT_SLACK * slack) & (low > 0.0)
    too_hot = (heat <= -AT_SLACK * slack) & (high < 0.0)
    is_low = (heat > 0.0) | ((heat == 0.0) & (low + high >= 0.0))
    given = slack * (too_cold.astype(float) - too_hot)
    more = here.cross_curvature * (charge - here.at.charge)
    response = of_heat / p.t_end**2
    is_none = too_cold | too_hot | (response < LEAST_RESPONSE)
    side = np.where(is_none, 0.0, np.where(is_low, 1.0, -1.0))
    offset = more / p.t_end - response * _sums(heat - given, decay)
    found = scan(offset, response, np.where(is_low, low, high), side, decay)
    return np.clip(found + given, -slack, slack)


def _sums(heat: Floats, decay: Floats) -> Floats:
    """Return M of multipliers."""
    sum_, found = 0.0, []
    for own, on in zip(heat[::-1].tolist(), decay[::-1].tolist(), strict=True):
        sum_ += own
        found.append(sum_)
        sum_ *= on
    return np.array(found[::-1])
