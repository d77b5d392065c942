"""Whether this is the motion of a road vehicle, in the stated units."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.errors import InputError

Flags = NDArray[np.bool_]

SPEED_MAX_MPS = 70.0
"""252 km/h: far beyond any car of the kind modelled here."""

ACCEL_MAX_MPS2 = 10.0
"""About 1 g, over a whole second: beyond the grip of road tyres either way."""

GRADE_MAX = 0.3
"""The steepest public streets are just above it; a larger number is most likely in percent."""

GRADE_MEAN_MAX = 0.12
"""Mean of |grade| over the way that a road up and down can have over `ROAD_MIN_M`.

The steepest roads of that length over a mountain, such as Mount Washington's, have 0.116 on either
side. A level road of which the grade in percent is read as rise over run has more.
"""

ROAD_MIN_M = 3000.0
ROLLING_MIN = 0.25
"""Least share of the rise that is also descended for a road up and down: a ramp is somebody's test,
not a road misread."""

GAP_MAX_S = 10.0
"""Longest gap that is filled by a straight line.

A logger's dropout in a tunnel lasts some seconds; over a longer one a straight line would hide
whole stops and their fuel.
"""

GAP_STANDING_MAX_S = 300.0
"""Longest gap where the car stands at both ends, as when the logger sleeps: a long red light.

Whoever stands longer has parked: engine and cabin are off, which a trip does not know. The rules
of the EU's real driving emissions test, too, take a trip apart at stops of 300 s.
"""

STANDING_MPS = 0.5
DURATION_MIN_S = 3.0
DURATION_MAX_S = 86400.0

POWER_P95_MAX_WPKG = 35.0
"""Largest 95th percentile of ``v a`` over the accelerating seconds of a genuine drive.

By the same statistic the EU's real driving emissions test (Regulation (EU) 2017/1151, Annex IIIA)
refuses aggressive driving, above 14 to 29 W/kg depending on the mean speed. The shipped cycles have
8 to 13 W/kg, the aggressive US06 schedule of the EPA 26. Reading km/h as m/s multiplies it by
3.6^2 = 13, reading mph as m/s by 5: the shipped cycles then have at least 41.
"""

POWER_SECONDS_MIN = 60
"""Accelerating seconds needed for that percentile; a short sprint may honestly exceed it."""

ACCELERATING_MPS2 = 0.1

MOVING_SPEED_MEAN_MAX_MPS = 50.0
"""180 km/h on average while moving."""

TO_MPS = "to get m/s, divide km/h by 3.6 or multiply mph by 0.44704"


def is_gap(time_s: Floats, speed_mps: Floats) -> Flags:
    """Whether the time from each sample to the next is too long to fill; shape (m-1,)."""
    standing = np.maximum(speed_mps[:-1], speed_mps[1:]) <= STANDING_MPS
    return np.diff(time_s) > np.where(standing, GAP_STANDING_MAX_S, GAP_MAX_S)


def check_samples(
    path: Path,
    lines: Sequence[int],
    time_s: Floats,
    speed_mps: Floats,
    grade: Floats,
    row: str = "line",
) -> None:
    """Check the ranges of the samples and the order of time.

    Parameters
    ----------
    path, lines
        For the message: the file and the line of each sample.
    time_s, speed_mps, grade
        Finite samples of the file. Shape (m,), m >= 2.
    row
        What the file calls a line.

    Raises
    ------
    InputError
        At the first sample that is out of range.
    """
    step_s = np.diff(time_s)

    def refuse(first: int, bad: Flags, values: Floats, message: str) -> None:
        _refuse(path, row, lines[first:], bad, values, message)

    refuse(1, step_s <= 0, time_s[1:], "time_s is {:.10g}, must increase strictly")
    refuse(0, speed_mps < 0, speed_mps, "speed_mps is {:g}, must not be negative")
    refuse(
        0,
        speed_mps > SPEED_MAX_MPS,
        speed_mps,
        f"speed_mps is {{:g}}, must be 0 to {SPEED_MAX_MPS:g} m/s; {TO_MPS}",
    )
    check_grade(path, lines, grade, row, "rise over run: divide percent by 100")
    duration_s = time_s[-1] - time_s[0]
    if not DURATION_MIN_S <= duration_s <= DURATION_MAX_S:
        raise InputError(
            f"{path}: the trip lasts {duration_s:g} s, must be {DURATION_MIN_S:g} s to 24 h"
        )
    refuse(
        1,
        is_gap(time_s, speed_mps),
        step_s,
        f"{{:g}} s without a sample, at most {GAP_MAX_S:g} s are allowed, "
        f"{GAP_STANDING_MAX_S:g} s standing: the motion in between is not known; if these are two "
        "trips, qpmpc convert --split makes a file of each",
    )


def check_grade(path: Path, lines: Sequence[int], grade: Floats, row: str, why: str) -> None:
    """Check that no sample is steeper than `GRADE_MAX`.

    Parameters
    ----------
    path, lines, row
        For the message, as of `check_samples`.
    grade
        Rise over run. Shape (m,).
    why
        How that may have come.

    Raises
    ------
    InputError
        At the first sample that is.
    """
    message = f"grade is {{:.3g}}, must be -{GRADE_MAX:g} to {GRADE_MAX:g}, {why}"
    _refuse(path, row, lines, np.abs(grade) > GRADE_MAX, grade, message)


def check_motion(
    path: Path, lines: Sequence[int], time_s: Floats, cycle: Cycle, row: str = "line"
) -> None:
    """Check that a road vehicle can move like this; catches most speeds in km/h or mph.

    It cannot catch all: a calm town trip in mph is a plausible brisk trip in m/s.

    Parameters
    ----------
    path, lines, time_s
        For the message: the file, and line and time of each sample. Shape (m,).
    cycle
        The drive at 1 Hz: noise between its points is ignored.
    row
        What the file calls a line.

    Raises
    ------
    InputError
        If an acceleration, the specific power or the mean speed is out of reach.
    """
    speed, accel = cycle.step_speed_mps, cycle.step_accel_mps2
    accelerating = accel > ACCELERATING_MPS2
    if np.count_nonzero(accelerating) >= POWER_SECONDS_MIN:
        power_wpkg = float(np.percentile((speed * accel)[accelerating], 95))
        if power_wpkg > POWER_P95_MAX_WPKG:
            raise InputError(
                f"{path}: one accelerating second in twenty takes over {power_wpkg:.0f} W/kg, "
                f"in real driving at most {POWER_P95_MAX_WPKG:g}; the speeds look like km/h or "
                f"mph: {TO_MPS}"
            )
    moving = speed > 0
    mean_mps = float(np.mean(speed[moving])) if np.any(moving) else 0.0
    if mean_mps > MOVING_SPEED_MEAN_MAX_MPS:
        raise InputError(
            f"{path}: the mean speed while moving is {mean_mps:.0f}, must be at most "
            f"{MOVING_SPEED_MEAN_MAX_MPS:g} m/s; the speeds look like km/h or mph: {TO_MPS}"
        )
    if np.any(np.abs(accel) > ACCEL_MAX_MPS2):
        k = int(np.argmax(np.abs(accel) > ACCEL_MAX_MPS2))
        last = int(np.searchsorted(time_s - time_s[0], k, side="right"))
        line = lines[min(last, len(lines) - 1)]
        raise InputError(
            f"{path}, {row} {line}: the speed changes by {accel[k]:.1f} m/s in a second, at most "
            f"{ACCEL_MAX_MPS2:g} are allowed; a wrong sample, or a wrong unit: {TO_MPS}"
        )


def check_road(path: Path, cycle: Cycle) -> None:
    """Check that a road can be this steep; catches grades in percent on a level road.

    Raises
    ------
    InputError
        If the road goes up and down, and is steeper all along than any over a mountain.
    """
    way_m, rise_m = cycle.step_speed_mps, cycle.step_speed_mps * cycle.step_grade
    length_m = float(np.sum(way_m))
    up_m, down_m = float(np.sum(rise_m[rise_m > 0])), -float(np.sum(rise_m[rise_m < 0]))
    if length_m < ROAD_MIN_M or min(up_m, down_m) < ROLLING_MIN * max(up_m, down_m):
        return
    mean = (up_m + down_m) / length_m
    if mean > GRADE_MEAN_MAX:
        raise InputError(
            f"{path}: grade is {mean:.2g} in the mean, up and down over {length_m / 1e3:.1f} km; "
            f"no road has more than {GRADE_MEAN_MAX:g}, rise over run: divide percent by 100"
        )


def _refuse(
    path: Path, row: str, lines: Sequence[int], bad: Flags, values: Floats, message: str
) -> None:
    """Raise at the first bad sample; `message` has a placeholder for its value."""
    if np.any(bad):
        k = int(np.argmax(bad))
        raise InputError(f"{path}, {row} {lines[k]}: {message.format(values[k])}")
