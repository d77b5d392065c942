"""What a trip is composed of: roads in order, and the seconds on each."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.trips.draws import Draws
from qpmpc.cycles.trips.micro_trips import (
    CITY,
    MOTORWAY,
    RURAL,
    SUBURB,
    draw_closing,
    draw_micro_trip,
)
from qpmpc.cycles.trips.motorway import SHORTEST_S, motorway

ROADS = (CITY, SUBURB, RURAL, MOTORWAY)

TYPES = ("city", "suburb", "mixed", "motorway")
SHARES = (  # of the types, by the duration below which they hold
    (300.0, (0.60, 0.40, 0.00, 0.00)),
    (900.0, (0.40, 0.30, 0.30, 0.00)),
    (2400.0, (0.20, 0.20, 0.40, 0.20)),
    (np.inf, (0.10, 0.10, 0.40, 0.40)),
)
"""Short trips are local, long ones are not: assumed."""

STOP_MEDIAN_S, STOP_SPREAD = {CITY: 11.0, SUBURB: 10.0, RURAL: 9.0, MOTORWAY: 9.0}, 0.8
STOP_S = (2, 120)
STOP_SHARE_MAX = 0.15  # of the trip
STANDING_S = (3, 12)  # before the first drive, and after the last
CLOSING_S = 90  # from here on a micro-trip that ends the trip is looked for
LEAST_S = 24  # what is left of a part is not filled below it
RURAL_FROM_S, MOTORWAY_FROM_S = 180.0, 240.0
MOTORWAY_PART_S = (1200.0, 3000.0)  # between stops, on a long way


class Wanted(NamedTuple):
    """A trip on a level road: speed at whole seconds, and the number of its road in `ROADS`."""

    speed_mps: Floats
    road: NDArray[np.intp]


def trip_type(duration_s: float, quantile: float) -> str:
    """Type at a quantile, 0..1, of those of this duration."""
    shares = next(shares for below, shares in SHARES if duration_s < below)
    return TYPES[int(np.searchsorted(np.cumsum(shares)[:-1], quantile, side="right"))]


def compose(draws: Draws, kind: str, duration_s: int) -> Wanted:
    """Draw the motion of a trip of exactly this duration, at rest at both ends."""
    parts = _parts(draws, kind, duration_s)
    speed: list[Floats] = []
    road: list[NDArray[np.intp]] = []
    left = duration_s + 1  # points

    def add(piece: Floats, where: str) -> None:
        nonlocal left
        speed.append(piece)
        road.append(np.full(len(piece), ROADS.index(where)))
        left -= len(piece)

    add(np.zeros(_within(STANDING_S, draws)), parts[0][0])
    for number, (where, seconds) in enumerate(parts):
        is_last = number == len(parts) - 1
        end = 0 if is_last else max(left - round(seconds), 0)
        while left - end >= LEAST_S:
            piece = _closing(draws, where, left) if is_last else None
            if piece is None:
                piece = _piece(draws, where, left - end - STOP_S[0])
            if piece is None:
                if not is_last or where == CITY:
                    break
                where = CITY if where == SUBURB else SUBURB
                continue
            add(piece[1:], where)
            stop = round(draws.lognormal(STOP_MEDIAN_S[where], STOP_SPREAD))
            stop = min(
                max(stop, STOP_S[0]), STOP_S[1], round(STOP_SHARE_MAX * duration_s), left - LEAST_S
            )
            if left >= LEAST_S:  # else the trip is over
                add(np.zeros(max(stop, 0)), where)
    add(np.zeros(left), where)
    return Wanted(np.concatenate(speed), np.concatenate(road))


def _within(range_s: tuple[int, int], draws: Draws) -> int:
    return range_s[0] + draws.integer(range_s[1] - range_s[0] + 1)


def _closing(draws: Draws, where: str, left_s: int) -> Floats | None:
    """Draw a last micro-trip, which ends some seconds before the trip does."""
    if where == MOTORWAY or left_s > CLOSING_S:
        return None
    return draw_closing(draws, where, left_s - _within(STANDING_S, draws))


def _piece(draws: Draws, where: str, longest_s: int) -> Floats | None:
    if where != MOTORWAY:
        return draw_micro_trip(draws, where, longest_s)
    seconds = min(longest_s, round(draws.uniform(*MOTORWAY_PART_S)))
    return motorway(draws, seconds) if seconds >= SHORTEST_S else None


def _parts(draws: Draws, kind: str, duration_s: float) -> list[tuple[str, float]]:
    """Roads in order with the seconds on each; the last takes what the others leave."""
    if kind == "city":
        return [(CITY, duration_s)]
    if kind == "suburb":
        ways = [(SUBURB, 0.5), (CITY, 0.2), (SUBURB, 0.3)] if duration_s > 600 else [(SUBURB, 1.0)]
    elif kind == "mixed":
        fast = draws.uniform(0.3, 0.6)
        road = MOTORWAY if fast * duration_s > MOTORWAY_FROM_S and draws.uniform() < 0.5 else RURAL
        near = draws.uniform(0.3, 0.7) * (1.0 - fast)
        ways = [(CITY, near * 0.5), (SUBURB, near * 0.5), (road, fast), (CITY, 0.0)]
        if draws.uniform() < 0.5:  # home instead of to work
            ways = [(SUBURB, near), (road, fast), (SUBURB, 0.0)]
    else:
        fast = draws.uniform(0.6, 0.85)
        country = draws.uniform(0.0, 0.3) * (1.0 - fast)
        ways = [(SUBURB, 0.4 * (1.0 - fast)), (MOTORWAY, fast), (RURAL, country), (SUBURB, 0.0)]
    return [
        (where, share * duration_s)
        for where, share in ways
        if where != RURAL or share * duration_s > RURAL_FROM_S
    ]
