"""Micro-trips, from standstill to standstill, of the shipped cycles; no two uses are equal."""

from functools import cache

import numpy as np

from qpmpc.cycles.catalogue import catalogue
from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.shipped import shipped_cycle
from qpmpc.cycles.standstill import phases
from qpmpc.cycles.trips.draws import Draws

CITY, SUBURB, RURAL, MOTORWAY = "city", "suburb", "rural", "motorway"

SOURCES = ("nycc", "udds", "hwfet", "wltc-3b")
"""Cycles that were driven; the straight lines of the NEDC were not."""

CREEP_MPS = 2.0
"""A micro-trip that never exceeds it is a car that creeps in a queue: taken as standing."""

FASTEST_MPS = 30.0
"""Faster micro-trips are motorway, which is not taken from the cycles: there is one only."""

MEAN_MPS = {CITY: 8.0, SUBURB: 15.5}
"""Mean speed below which a micro-trip is of the class; above both it is rural."""

SPEED_SPREAD, TIME_SPREAD = 0.10, 0.08  # greatest change of speed and time, either way
ACCEL_MAX_MPS2 = 2.6
"""The shipped cycles reach 2.7, between -2.6 and 2.7, and no stretch goes beyond."""

NOISE_SHARE, NOISE_MOST, NOISE_POLE = 0.03, 2.5, 0.9
"""Slow deviations from the stretched trace: sd 3 % of the speed, at most 2.5 sd, correlated over
some 20 s."""

CUT_FROM, CUT_SHARE = 120, 0.6  # points from which a micro-trip may lose a part, and how often
CUT_ENDS, CUT_LEAST = 15, 20  # points that are kept at either end, and least that are left out
CUT_MPS, CUT_MPS2 = 0.3, 0.25  # what speed and acceleration may differ by at the seam


@cache
def micro_trips() -> dict[str, tuple[Floats, ...]]:
    """Micro-trips of the shipped cycles by class, both ends at rest, the shortest first."""
    found: dict[str, list[Floats]] = {CITY: [], SUBURB: [], RURAL: []}
    for entry in catalogue():
        if entry.name not in SOURCES:
            continue
        speed = shipped_cycle(entry).speed_mps
        for first, end, standing in phases(speed):
            piece = speed[max(first - 1, 0) : end + 1]
            if not standing and CREEP_MPS < piece.max() < FASTEST_MPS:
                mean = piece[1:-1].mean()
                road = next((road for road, most in MEAN_MPS.items() if mean < most), RURAL)
                found[road].append(piece)
    return {road: tuple(sorted(pieces, key=len)) for road, pieces in found.items()}


def draw_micro_trip(draws: Draws, road: str, longest_s: int) -> Floats | None:
    """Draw a micro-trip of at most `longest_s` seconds, changed so that it is a new one.

    Returns
    -------
    speed at whole seconds, 0 at both ends; None if none is short enough
    """
    fitting = [piece for piece in micro_trips()[road] if _within_s(piece, longest_s)[0]]
    if not fitting:
        return None
    piece = draws.choice(fitting)
    if len(piece) >= CUT_FROM and (draws.uniform() < CUT_SHARE or len(piece) - 1 > longest_s):
        piece = _cut(draws, piece)
    stretch = 1.0 + draws.uniform(-TIME_SPREAD, TIME_SPREAD)
    return _changed(draws, piece, min(round((len(piece) - 1) * stretch), longest_s))


def draw_closing(draws: Draws, road: str, seconds: int) -> Floats | None:
    """Draw a micro-trip of exactly this length; None if none can be stretched to it."""
    fitting = [piece for piece in micro_trips()[road] if all(_within_s(piece, seconds))]
    return _changed(draws, draws.choice(fitting), seconds) if fitting else None


def slow_noise(draws: Draws, count: int, pole: float) -> Floats:
    """Smooth Gaussian noise of unit variance: white noise through a double pole."""
    from scipy.signal import lfilter  # here: importing it takes a second

    settle = int(20.0 / (1.0 - pole))
    white = draws.normals(settle + count)
    smooth = lfilter([1.0], [1.0, -2.0 * pole, pole * pole], white)[settle:]
    return np.asarray(smooth / np.sqrt((1.0 + pole**2) / (1.0 - pole**2) ** 3))


def _within_s(piece: Floats, seconds: int) -> tuple[bool, bool]:
    """Whether a micro-trip can be squeezed into, and be stretched to, a number of seconds."""
    steps = len(piece) - 1
    return steps * (1.0 - TIME_SPREAD) <= seconds, steps * (1.0 + TIME_SPREAD) >= seconds


def _changed(draws: Draws, piece: Floats, steps: int) -> Floats:
    """Another duration, another speed, and other deviations from it; slower if too brisk."""
    at = np.linspace(0.0, len(piece) - 1.0, steps + 1)
    speed = np.interp(at, np.arange(float(len(piece))), piece)
    speed *= 1.0 + draws.uniform(-SPEED_SPREAD, SPEED_SPREAD)
    noise = np.clip(slow_noise(draws, len(speed), NOISE_POLE), -NOISE_MOST, NOISE_MOST)
    speed *= 1.0 + NOISE_SHARE * noise
    return np.asarray(speed * min(ACCEL_MAX_MPS2 / np.abs(np.diff(speed)).max(), 1.0))


def _cut(draws: Draws, piece: Floats) -> Floats:
    """Leave out a part from the middle, between two points of equal speed and acceleration."""
    accel = np.gradient(piece)
    first = CUT_ENDS + draws.integer(len(piece) - 2 * CUT_ENDS - CUT_LEAST)
    later = np.arange(first + CUT_LEAST, len(piece) - CUT_ENDS)
    alike = later[
        (np.abs(piece[later] - piece[first]) < CUT_MPS)
        & (np.abs(accel[later] - accel[first]) < CUT_MPS2)
    ]
    if len(alike) == 0 or piece[first] < CREEP_MPS:
        return piece
    second = alike[draws.integer(len(alike))]
    return np.concatenate([piece[:first], piece[second:]])
