r"""Grade from elevation: smoothed over the way, rise over run.

``g(s) = d/ds (G * z)(s)``, z the elevation at the way s, G a Gaussian of `SMOOTH_M`. Over the
way, not over time: while the car stands, drift of the receiver makes no grade, since all samples
of a place give one elevation, their mean.

The length is a choice between noise and hills. On every fourth `train` trip (rms grade 1.5 %) with
noise of correlation time T in s added to the elevation, the error of the grade is, rms over the
way in %, and the climb is, as a share of the true one:

    standard deviation of G, m            50          100         150         200         300
    whole metres, no noise             0.19 0.98   0.17 0.95   0.25 0.92   0.33 0.89   0.46 0.83
    noise 1 m, T = 30                  0.56 1.13   0.38 1.02   0.36 0.96   0.39 0.92   0.48 0.85
    noise 2 m, T = 60                  0.92 1.24   0.63 1.08   0.53 1.00   0.51 0.95   0.54 0.86
    noise 3 m, T = 30                  1.67 1.72   1.04 1.35   0.80 1.18   0.69 1.08   0.64 0.96
    noise 5 m, T = 60                  2.19 1.99   1.44 1.52   1.14 1.31   0.99 1.19   0.86 1.03

Polynomials (Savitzky-Golay) of the same error pass more noise as climb, and a median before the
filter gains nothing.
"""

from dataclasses import replace

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.columns import ASSUMED, READ, LogColumns, Said
from qpmpc.cycles.logs.smooth import smoothed

SMOOTH_M = 150.0
SPACING_M = 10.0
WAY_MIN_M = 100.0
"""Below it a rise over run is noise: the road counts as level."""


def filtered_elevation(log: LogColumns) -> tuple[Floats, Floats, Floats]:
    """Filter the elevation over the way.

    Returns
    -------
    way_m : of each sample, shape (m,)
    places_m : `SPACING_M` apart, from the first elevation to the last, shape (n,)
    elevation_m : filtered, at these places, shape (n,)
    """
    speed, time, raw_m = log.speed_mps, log.time_s, log.elevation_m
    if raw_m is None:
        raise ValueError("the log has no elevation")
    steps_m = (speed[:-1] + speed[1:]) / 2 * np.diff(time)
    way_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    known = np.isfinite(raw_m)
    cell = np.round(way_m[known] / SPACING_M).astype(np.intp)
    number = np.bincount(cell)
    filled = np.flatnonzero(number)
    mean_m = np.bincount(cell, raw_m[known])[filled] / number[filled]
    at_m = np.bincount(cell, way_m[known])[filled] / number[filled]
    places_m = np.arange(at_m[0], at_m[-1] + 1e-9, SPACING_M)
    return way_m, places_m, smoothed(np.interp(places_m, at_m, mean_m), SMOOTH_M / SPACING_M)


def with_grade(log: LogColumns) -> LogColumns:
    """Return a log with the grade of its elevation; where it has neither, nothing is done."""
    if log.grade is not None or log.elevation_m is None:
        return log
    known = log.elevation_m[np.isfinite(log.elevation_m)]
    flat = np.zeros(len(log.time_s))
    if len(known) < 2:
        return _with(log, flat, Said(ASSUMED, "a level road: the elevation has no values"))
    way_m, places_m, height_m = filtered_elevation(log)
    length_m = places_m[-1] - places_m[0]
    if length_m < WAY_MIN_M:
        why = f"a level road: {length_m:.0f} m are too short for a grade from elevation"
        return _with(log, flat, Said(ASSUMED, why))
    middle_m = (places_m[:-1] + places_m[1:]) / 2
    beyond = (way_m < places_m[0] - SPACING_M) | (way_m > places_m[-1] + 2.0 * SPACING_M)
    grade = np.where(beyond, 0.0, np.interp(way_m, middle_m, np.diff(height_m) / SPACING_M))
    before, after = _climb_m(known), _climb_m(height_m)
    text = (
        f"grade from elevation: Gaussian filter over {SMOOTH_M:.0f} m of way, rise over run; of "
        f"{before:.0f} m of climb in the samples {after:.0f} m are left"
    )
    missing = len(log.time_s) - len(known)
    said = [Said(READ, text)]
    if missing:
        said.append(
            Said(
                ASSUMED,
                f"elevation missing in {missing} rows: between its neighbours, level beyond",
            )
        )
    return _with(log, grade, *said)


def _with(log: LogColumns, grade: Floats, *said: Said) -> LogColumns:
    return replace(log, grade=grade).also(*said)


def _climb_m(elevation_m: Floats) -> float:
    return float(np.sum(np.maximum(np.diff(elevation_m), 0.0)))
