"""What is possible on a road but unusual: said in a line, not refused.

A car of 6 s from 0 to 100 km/h, or a pass in the Alps, is nobody's mistake. Yet speeds in mph or
km/h, or a grade in percent, that are read in the wrong unit look like these, and most cannot be
told from them. The thresholds were chosen on the `train` trips: none of them is mentioned, of their
parts of 60 s or more 0.5 %, of those of the shipped cycles 1.7 %.
"""

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.plausibility import (
    ACCELERATING_MPS2,
    GAP_STANDING_MAX_S,
    GRADE_MEAN_MAX,
    STANDING_MPS,
)

POWER_P95_WPKG = 26.0
"""95th percentile of ``v a`` over the accelerating seconds: 23 on parts of `train`, 20 on those of
shipped cycles, 26 over the whole of the aggressive US06."""

ACCELERATING_MIN = 3
"""Accelerating seconds for that percentile."""

BRAKING_WPKG = 45.0
"""Largest ``-v a``: firm braking from motorway speed; 40 on `train`, 27 on shipped cycles."""

ACCEL_MPS2 = 3.0
"""Either way, over a second: 2.6 on `train`, 2.7 on shipped cycles, and few drivers more."""

ACCEL_RMS_MPS2 = 1.3
"""Over the moving seconds: 1.1 on whole trips, 1.3 on the liveliest minute of a shipped cycle."""

MOVING_MIN = 20
"""Moving seconds for that mean."""

JERK_MPS3 = 3.0
"""Change of the acceleration from second to second: 2.5 on both. A speed in whole km/h adds 0.6."""

MEAN_MOVING_MPS = 40.0
"""144 km/h in the mean of the moving seconds: 37 on `train`, 36 on shipped cycles."""

SPEED_MPS = 50.0
"""180 km/h."""

CALM_MPS2 = 0.7
"""Median over all stops and starts of the largest deceleration before and acceleration after: on
`train` and the shipped cycles 0.8 at least, on minutes of them seldom less."""

AROUND_STOP_S = 15
"""Before a stop and after a start, for that; both must be there in full."""

GRADE_WAY_MIN_M = 1000.0
"""For the mean of |grade|: over a shorter way than `check_road` asks for, and for ramps too."""

CLIMB_MEAN_MPS = 2.0
"""Height per second of driving, up or down: a pass of 10 % at 70 km/h."""

UNIT_DOUBTED = "is the unit of speed right? km/h read as m/s are 3.6 times too fast, mph 2.2 times"


def suspicions(cycle: Cycle) -> list[str]:
    """Return what is unusual about a cycle: a line each on its motion, its stops and its road."""
    brisk, road = _brisk(cycle), _road(cycle)
    lines = []
    if brisk:
        lines.append(f"unusual for a car: {', '.join(brisk)}; {UNIT_DOUBTED}")
    calm_mps2 = _around_stops_mps2(cycle)
    if calm_mps2 < CALM_MPS2:
        lines.append(
            f"slow for a car: stops and starts at {calm_mps2:.2g} m/s^2 (below {CALM_MPS2:g}); is "
            "the unit of speed right?"
        )
    parked_s = _longest_stop_s(cycle)
    if parked_s > GAP_STANDING_MAX_S:
        lines.append(
            f"stands for {parked_s / 60:.0f} min: engine and cabin are kept warm; if it is parked, "
            "qpmpc convert --split makes a file of each trip"
        )
    if road:
        lines.append(
            f"unusual for a road: {road}; is the grade rise over run? Else divide percent by 100"
        )
    return lines


def _brisk(cycle: Cycle) -> list[str]:
    speed, accel = cycle.step_speed_mps, cycle.step_accel_mps2
    found = []
    power = speed * accel
    accelerating = power[accel > ACCELERATING_MPS2]
    if len(accelerating) >= ACCELERATING_MIN:
        p95 = float(np.percentile(accelerating, 95))
        found.append(_above(p95, POWER_P95_WPKG, "W/kg accelerating"))
    found.append(_above(_largest(np.minimum(power, 0.0)), BRAKING_WPKG, "W/kg braking"))
    found.append(_above(_largest(accel), ACCEL_MPS2, "m/s^2"))
    moving = speed > 0
    if np.count_nonzero(moving) >= MOVING_MIN:
        rms = float(np.sqrt(np.mean(accel[moving] ** 2)))
        found.append(_above(rms, ACCEL_RMS_MPS2, "m/s^2 in the mean"))
    found.append(_above(_largest(np.diff(accel)), JERK_MPS3, "m/s^3"))
    mean_mps = float(np.mean(speed[moving])) if np.any(moving) else 0.0
    found.append(_above(mean_mps, MEAN_MOVING_MPS, "m/s in the mean"))
    found.append(_above(float(np.max(cycle.speed_mps)), SPEED_MPS, "m/s"))
    return [text for text in found if text]


def _around_stops_mps2(cycle: Cycle) -> float:
    """Median of the largest changes of speed around stops; infinite if there are none."""
    standing, accel = cycle.speed_mps <= 0.0, cycle.step_accel_mps2
    stops = np.flatnonzero(~standing[:-1] & standing[1:]) + 1
    starts = np.flatnonzero(standing[:-1] & ~standing[1:])
    around = AROUND_STOP_S
    largest = [
        *(-accel[k - around : k].min() for k in stops if k >= around),
        *(accel[k : k + around].max() for k in starts if k + around <= len(accel)),
    ]
    return float(np.median(largest)) if largest else np.inf


def _longest_stop_s(cycle: Cycle) -> float:
    standing = np.concatenate([[False], cycle.speed_mps <= STANDING_MPS, [False]])
    edges = np.flatnonzero(np.diff(standing.astype(np.int8)))
    return float(np.max(edges[1::2] - edges[::2] - 1, initial=0))


def _road(cycle: Cycle) -> str:
    way_m, slope = cycle.step_speed_mps, np.abs(cycle.step_grade)
    length_m, height_m = float(np.sum(way_m)), float(np.sum(way_m * slope))
    if length_m < GRADE_WAY_MIN_M:
        return ""
    steep = _above(height_m / length_m, GRADE_MEAN_MAX, "grade in the mean")
    climbing_mps = height_m / np.count_nonzero(way_m)
    return steep or _above(climbing_mps, CLIMB_MEAN_MPS, "m/s up or down in the mean")


def _above(value: float, threshold: float, what: str) -> str:
    return f"{value:.3g} {what} (above {threshold:g})" if value > threshold else ""


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))
