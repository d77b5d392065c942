"""Several trips in one log: by the file's own column, by gaps and by parking."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from qpmpc.cycles.logs.columns import LEFT_OUT, LogColumns, Said
from qpmpc.cycles.plausibility import GAP_STANDING_MAX_S, STANDING_MPS, is_gap
from qpmpc.errors import InputError
from qpmpc.problems import shown_value

KEPT_S = 5.0
"""Of parking at either end of a trip."""

TRIP_MIN_S = 30.0
TRIP_MIN_M = 100.0
"""What is shorter is a car that is moved, or a rest."""

IDS_SHOWN = 8


def by_trip(path: Path, log: LogColumns, trip: str | None, split: bool) -> list[LogColumns]:
    """Return the samples of each trip that the file names, or of one of them.

    Parameters
    ----------
    trip : the only one to return
    split : whether several are wanted

    Raises
    ------
    InputError
        If there are several and none is chosen, or the chosen one is not there.
    """
    names = list(dict.fromkeys(log.trips or ()))
    shown = ", ".join(shown_value(name) for name in names[:IDS_SHOWN])
    shown += f" and {len(names) - IDS_SHOWN} more" if len(names) > IDS_SHOWN else ""
    if trip is not None:
        if not names:
            raise InputError(f"{path}: --trip has no effect: the file names no trips")
        if trip not in names:
            raise InputError(f"{path}: --trip {shown_value(trip)}: there are {shown}")
        names = [trip]
    elif len(names) > 1 and not split:
        raise InputError(
            f"{path}: {len(names)} trips, {shown}: qpmpc convert takes one with --trip, or makes a "
            "file of each with --split"
        )
    if log.trips is None or len(set(log.trips)) == 1:
        return [log]
    of_rows = np.array(log.trips)
    return [
        log.taken(of_rows == name, Said(LEFT_OUT, f"all trips but {shown_value(name)}"))
        if trip is not None
        else log.taken(of_rows == name)
        for name in names
    ]


def at_gaps(log: LogColumns) -> tuple[list[LogColumns], list[Said]]:
    """Split samples where the log has a gap, time begins anew, or the car is parked.

    A car is parked if it stands for more than `GAP_STANDING_MAX_S`; `KEPT_S` of that are kept at
    either side. What is shorter than `TRIP_MIN_S` or `TRIP_MIN_M` is left out.

    Returns
    -------
    trips
    said : where and why it was split, and what was left out
    """
    restarts = np.flatnonzero(np.diff(log.time_s) < 0.0) + 1
    edges = [0, *restarts.tolist(), len(log.time_s)]
    said = [_at(log, int(k), "time begins anew: split") for k in restarts]
    trips: list[LogColumns] = []
    for begin, end in pairwise(edges):
        for a, b in _parts(log, begin, end, said):
            part = log.taken(np.arange(a, b))
            seconds = float(part.time_s[-1] - part.time_s[0]) if b > a else 0.0
            steps_m = (part.speed_mps[:-1] + part.speed_mps[1:]) / 2 * np.diff(part.time_s)
            way_m = float(np.sum(steps_m))
            if seconds >= TRIP_MIN_S and way_m >= TRIP_MIN_M:
                trips.append(part)
            elif b > a:
                said.append(_at(log, a, f"{seconds:.0f} s, {way_m:.0f} m left out: no trip"))
    return trips, said


def _parts(log: LogColumns, begin: int, end: int, said: list[Said]) -> Iterator[tuple[int, int]]:
    """First sample of each trip, and one after its last; time increases from begin to end."""
    time_s, speed = log.time_s[begin:end], log.speed_mps[begin:end]
    start = 0
    for a, b, standing in _cuts(log, begin, end):
        if standing:
            text = f"parked for {(time_s[b] - time_s[a]) / 60:.0f} min: split"
            last = int(np.searchsorted(time_s, time_s[a] + KEPT_S, side="right"))
            first = int(np.searchsorted(time_s, time_s[b] - KEPT_S, side="left"))
        else:
            text = f"{time_s[b] - time_s[a]:.0f} s without a sample: split"
            last, first = b, b
        said.append(_at(log, begin + b, text))
        yield begin + start, begin + last
        start = first
    yield begin + start, begin + len(speed)


def _cuts(log: LogColumns, begin: int, end: int) -> Iterator[tuple[int, int, bool]]:
    """Last sample before and first after each cut, in order; for parking, both stand."""
    time_s, speed = log.time_s[begin:end], log.speed_mps[begin:end]
    standing = np.concatenate([[False], speed <= STANDING_MPS, [False]])
    change = np.diff(standing.astype(np.int8))
    runs = zip(np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1, strict=True)
    parked = [(int(a), int(b), True) for a, b in runs if time_s[b] - time_s[a] > GAP_STANDING_MAX_S]
    gaps = [
        (int(k), int(k) + 1, False)
        for k in np.flatnonzero(is_gap(time_s, speed))
        if not any(a <= k < b for a, b, _ in parked)
    ]
    yield from sorted(parked + gaps)


def _at(log: LogColumns, k: int, text: str) -> Said:
    return Said(LEFT_OUT, f"{log.row} {log.rows[k]}: {text}")
