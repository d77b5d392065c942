"""What is possible on a road but unusual: said in a line, not refused.

A car of 6 s from 0 to 100 km/h, or a pass in the Alps, is nobody's mistake. Yet speeds in mph or
km/h, or a grade in percent, that are read in the wrong unit look like these, and most cannot be
told from them. The thresholds leave every part of the shipped cycles of 60 s or more unmentioned.
"""

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.plausibility import ACCELERATING_MPS2, GRADE_MEAN_MAX, TO_MPS

POWER_P95_WPKG = 28.0
"""95th percentile of ``v a`` over the accelerating seconds.

Parts of the shipped cycles reach 20, the whole of the aggressive US06 26.
"""

ACCELERATING_MIN = 5

ACCEL_MPS2 = 3.5
"""Either way, over a second: the shipped cycles have 2.7, and few drivers more."""

JERK_MPS3 = 4.0
"""Change of the acceleration from second to second: the shipped cycles have 2.5."""

MEAN_MOVING_MPS = 42.0
"""151 km/h in the mean of the moving seconds: the shipped cycles have 36."""

SPEED_MPS = 55.0
"""198 km/h."""

GRADE_WAY_MIN_M = 1000.0
"""For the mean of |grade|: over a shorter way than `check_road` asks for, and for ramps too."""

CLIMB_MEAN_MPS = 2.0
"""Height per second of driving, up or down: a pass of 10 % at 70 km/h."""


def suspicions(cycle: Cycle) -> list[str]:
    """Return what is unusual about a cycle: one line on its motion, one on its road."""
    motion, road = _motion(cycle), _road(cycle)
    lines = []
    if motion:
        lines.append(f"unusual for a car: {', '.join(motion)}; are the speeds in m/s? {TO_MPS}")
    if road:
        lines.append(
            f"unusual for a road: {road}; is the grade rise over run? Else divide percent by 100"
        )
    return lines


def _motion(cycle: Cycle) -> list[str]:
    speed, accel = cycle.step_speed_mps, cycle.step_accel_mps2
    found = []
    power = (speed * accel)[accel > ACCELERATING_MPS2]
    if len(power) >= ACCELERATING_MIN:
        found.append(_above(float(np.percentile(power, 95)), POWER_P95_WPKG, "W/kg accelerating"))
    found.append(_above(_largest(accel), ACCEL_MPS2, "m/s^2"))
    found.append(_above(_largest(np.diff(accel)), JERK_MPS3, "m/s^3"))
    moving = speed[speed > 0]
    mean_mps = float(np.mean(moving)) if len(moving) else 0.0
    found.append(_above(mean_mps, MEAN_MOVING_MPS, "m/s in the mean"))
    found.append(_above(float(np.max(cycle.speed_mps)), SPEED_MPS, "m/s"))
    return [text for text in found if text]


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
