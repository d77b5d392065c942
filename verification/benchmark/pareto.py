"""Fuel and time of each candidate over all trips, and the Pareto front."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

SAME_PERCENT = 0.005  # of fuel above DP: half the last digit of the tables


@dataclass(frozen=True)
class Point:
    """A candidate over all trips.

    Attributes
    ----------
    median_ms, worst_ms : of all steps of all trips; nan where it decides nothing, as dp does not
    above_dp_percent : of each trip
    sound : no limit violated, no second driven by a fallback, every trip comparable
    """

    label: str
    family: str
    median_ms: float
    worst_ms: float
    above_dp_percent: tuple[float, ...]
    sound: bool

    @property
    def fuel(self) -> float:
        """Median over trips of fuel above DP, %."""
        return float(np.median(self.above_dp_percent))


def points(rows: Sequence[dict[str, Any]]) -> list[Point]:
    """Gather the rows of each candidate, the quickest worst step first."""
    found = []
    for label in dict.fromkeys(row["candidate"] for row in rows):
        own = [row for row in rows if row["candidate"] == label]
        times = [row["step_time_ms"] for row in own if row["step_time_ms"]]
        found.append(
            Point(
                label,
                own[0]["family"],
                float(np.median([t["median"] for t in times])) if times else np.nan,
                max(t["max"] for t in times) if times else np.nan,
                tuple(row["fuel_above_dp_percent"] for row in own),
                all(is_sound(row) for row in own),
            )
        )
    return sorted(found, key=lambda p: (np.isnan(p.worst_ms), p.worst_ms))


def is_sound(row: dict[str, Any]) -> bool:
    """Whether a run kept all limits by its own means."""
    kept = not any(value > 0 for value in row["violations"].values())
    return bool(row["comparable"] and kept and not row["fallback_steps"])


def front(found: Sequence[Point]) -> list[Point]:
    """Sound candidates that no quicker one equals in fuel to `SAME_PERCENT`, in order of time."""
    best = np.inf
    chosen = []
    for point in sorted(found, key=lambda p: (p.worst_ms, p.fuel)):
        if point.sound and np.isfinite(point.worst_ms) and point.fuel < best - SAME_PERCENT:
            chosen.append(point)
            best = point.fuel
    return chosen
