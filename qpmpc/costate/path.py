"""On or off at given costates, starts and shortest runs and rests included: exact."""

from itertools import product
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.engine_parameters import Engine

Floats = NDArray[np.float64]


class Shortest(NamedTuple):
    """How long the engine has to run or rest, in seconds, at least 1 each."""

    on_s: int
    off_s: int

    @classmethod
    def of(cls, engine: Engine) -> "Shortest":
        """Return those of an engine."""
        return cls(max(engine.min_on_s, 1), max(engine.min_off_s, 1))


class Path(NamedTuple):
    """The best choice second by second, and its cost."""

    runs: list[bool]
    cost: float


def shortest_path(
    on_cost: list[float],
    off_cost: list[float],
    start_cost: list[float],
    shortest: Shortest,
    is_on: bool,
    for_s: int,
    arrives: bool,
) -> Path:
    """Return the least-cost choice of on or off over some seconds.

    The state is on or off and for how long, up to the shortest run or rest, within which a change
    is not allowed; nor is a start that arrival would end early. A second in which the engine must
    run, or must not (infinite cost of the other), breaks that without a penalty.

    Parameters
    ----------
    on_cost, off_cost, start_cost : of each second, g
    shortest : run and rest
    is_on, for_s : engine state now, and since when
    arrives : whether the trip ends after the last second
    """
    seconds = len(on_cost)
    last_start = seconds - shortest.on_s if arrives else seconds
    ages = range(1, max(shortest) + 1)
    value = {(on, age): 0.0 for on in (False, True) for age in ages}
    choices: list[dict[tuple[bool, int], bool]] = []
    for k in range(seconds - 1, -1, -1):
        before, chosen = {}, {}
        for (on, age), _ in value.items():
            least_s = shortest.on_s if on else shortest.off_s
            stay_g = on_cost[k] if on else off_cost[k]
            stay_g += value[on, min(age + 1, max(shortest))]
            turn_g = (off_cost[k] if on else on_cost[k] + start_cost[k]) + value[not on, 1]
            may = age >= least_s and (on or k <= last_start)
            must = (on_cost[k] if on else off_cost[k]) == inf
            turns = must or (may and turn_g < stay_g)
            before[on, age] = turn_g if turns else stay_g
            chosen[on, age] = on != turns
        value = before
        choices.append(chosen)
    state = is_on, min(max(for_s, 1), max(shortest))
    cost, runs = value[state], []
    for chosen in reversed(choices):
        on, age = state
        runs.append(chosen[state])
        state = (on, min(age + 1, max(shortest))) if runs[-1] == on else (not on, 1)
    return Path(runs, cost)


def blocks_least(
    on_cost: Floats, off_cost: Floats, start_cost: Floats, rises: Floats, classes: int
) -> float:
    """Return the least cost of the long stages, engine on or off in each, starts included.

    Starts couple the stages of a block: all choices of a block are compared. What couples blocks is
    left out, or where a start pays by its heat taken in full: then no choice costs less.

    Parameters
    ----------
    on_cost, off_cost, start_cost, rises : shape (blocks * classes,)
    classes : stages of a block
    """
    if not len(on_cost):
        return 0.0
    on, off, price = (
        values.reshape(-1, classes) for values in (on_cost, off_cost, start_cost * np.abs(rises))
    )
    sign = np.sign(rises).reshape(-1, classes)
    totals = []
    for choice in product((0.0, 1.0), repeat=classes):
        runs = np.array(choice)
        starts = np.maximum(sign[:, 1:] * np.diff(runs), 0.0)
        stages = np.where(runs > 0.0, on, off).sum(axis=1)
        totals.append(stages + (price[:, 1:] * starts).sum(axis=1))
    return float((np.min(totals, axis=0) + np.minimum(price[:, 0], 0.0)).sum())
