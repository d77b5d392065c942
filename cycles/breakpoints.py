"""Cycles given as straight lines between breakpoints, such as the NEDC."""

import csv
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from qpmpc.cycles.cycle import Cycle

KMH_PER_MPS = 3.6


def read_breakpoints(path: Path, parts: Sequence[str], *, name: str) -> Cycle:
    """Drive `parts` one after the other and sample the speed at 1 Hz.

    The last breakpoint of a part is the first of the next: both have the same time and must have
    the same speed.

    Parameters
    ----------
    path
        CSV file with the columns ``part,time_s,speed_kmh``; each part starts at time 0.
    parts
        Names of parts, in the order driven, repetitions included.
    name
        Name of the cycle.

    Raises
    ------
    KeyError
        If the file has no such part.
    ValueError
        If the speed jumps between two parts.
    """
    table: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            table[row["part"]].append((float(row["time_s"]), float(row["speed_kmh"])))

    time_s: list[float] = []
    speed_kmh: list[float] = []
    for part in parts:
        if part not in table:
            raise KeyError(f"{path.name} has no part {part}")
        start_s = time_s.pop() if time_s else 0.0
        end_kmh = speed_kmh.pop() if speed_kmh else table[part][0][1]
        if end_kmh != table[part][0][1]:
            raise ValueError(f"{path.name}: speed jumps at the start of {part}")
        time_s += [start_s + time for time, _ in table[part]]
        speed_kmh += [speed for _, speed in table[part]]
    return Cycle.from_samples(name, time_s, [speed / KMH_PER_MPS for speed in speed_kmh])
