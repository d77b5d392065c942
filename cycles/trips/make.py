"""Make a trip from its name."""

from functools import cache
from typing import NamedTuple

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.trips.composition import ROADS, compose, trip_type
from qpmpc.cycles.trips.draws import Draws
from qpmpc.cycles.trips.driver import drive
from qpmpc.cycles.trips.hills import SPACING_M, STEEPEST, hills, terrain
from qpmpc.cycles.trips.names import LONGEST_S, SETS, SHORTEST_S, parse_name

_KEYS = {"train": 1, "judge": 2, "random": 3}  # of the streams of draws
_OF_SET, _OF_TRIP = 0, 1

SPEED_DIGITS, GRADE_DIGITS = 3, 5


class Plan(NamedTuple):
    """What is drawn first: duration, type and terrain."""

    duration_s: int
    kind: str
    ground: str


def make_trip(name: str) -> Cycle:
    """Make the trip of a name; always the same.

    Parameters
    ----------
    name
        ``train-000`` .. ``train-199``, ``judge-000`` .. ``judge-199``, ``random-SEED`` or
        ``random-SEED-SECONDSs``, as ``random-5-600s``.

    Raises
    ------
    InputError
        If it is none of these.
    """
    plan, draws = _begin(name)
    wanted = compose(draws, plan.kind, plan.duration_s)
    way_m = _way(wanted.speed_mps)
    points = np.arange(0.0, way_m[-1] + 2.0 * SPACING_M, SPACING_M)
    # the road at a place is that of the last second before leaving it
    place = np.minimum(np.searchsorted(way_m, points, side="right"), len(way_m) - 1)
    limits = np.asarray([STEEPEST[road] for road in ROADS])
    slopes = hills(draws, plan.ground, limits[wanted.road[place]])
    speed = np.round(drive(wanted.speed_mps, slopes), SPEED_DIGITS)
    grade = np.round(np.interp(_way(speed), points, slopes), GRADE_DIGITS)
    return Cycle(name, np.arange(float(len(speed))), speed, grade + 0.0)


def plan_of(name: str) -> Plan:
    """Return duration, type and terrain of a trip.

    Raises
    ------
    InputError
        If there is no such trip.
    """
    return _begin(name)[0]


def _begin(name: str) -> tuple[Plan, Draws]:
    group, number, duration_s = parse_name(name)
    draws = Draws(_KEYS[group], _OF_TRIP, number)
    quantiles = _quantiles(group)[number] if group in SETS else tuple(draws.uniforms(3).tolist())
    drawn_s = round(SHORTEST_S * (LONGEST_S / SHORTEST_S) ** quantiles[0])
    seconds = drawn_s if duration_s is None else duration_s
    return Plan(seconds, trip_type(seconds, quantiles[1]), terrain(quantiles[2])), draws


@cache
def _quantiles(group: str) -> tuple[tuple[float, float, float], ...]:
    """Quantiles of duration, type and terrain of each trip of a set: a Latin hypercube.

    Each of the three has exactly one trip in every 1/n of its range.
    """
    size, draws = SETS[group], Draws(_KEYS[group], _OF_SET)
    columns = [(np.asarray(draws.permutation(size)) + draws.uniforms(size)) / size for _ in "123"]
    return tuple((a, b, c) for a, b, c in np.stack(columns, axis=1).tolist())


def _way(speed: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum((speed[:-1] + speed[1:]) / 2.0)])
