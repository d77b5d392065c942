"""Figures that describe a cycle: motion and road."""

from typing import NamedTuple

import numpy as np

from qpmpc.cycles.cycle import Cycle
from qpmpc.cycles.plausibility import ACCELERATING_MPS2
from qpmpc.cycles.standstill import phases


class CycleStatistics(NamedTuple):
    """Figures of a cycle; those of the road are means over the way, not over time.

    Attributes
    ----------
    duration_s, distance_km : of the whole cycle
    speed_mean_kmh, speed_max_kmh : standing counts in the mean
    stops_per_km : stops after a drive, the last one too
    standing_percent : share of the time
    rpa_mps2 : relative positive acceleration, sum of ``v a`` where a > 0, by the distance
    va_p95_wpkg : 95th percentile of ``v a`` where a > 0.1 m/s^2
    grade_sd_percent : root mean square of the grade
    grade_max_percent : steepest, up or down
    climb_m_per_km : height gained uphill
    """

    duration_s: float
    distance_km: float
    speed_mean_kmh: float
    speed_max_kmh: float
    stops_per_km: float
    standing_percent: float
    rpa_mps2: float
    va_p95_wpkg: float
    grade_sd_percent: float
    grade_max_percent: float
    climb_m_per_km: float


def cycle_statistics(cycle: Cycle) -> CycleStatistics:
    """Compute the figures of a cycle; those by distance are 0 if it never moves."""
    speed, accel, grade = cycle.step_speed_mps, cycle.step_accel_mps2, cycle.step_grade
    way_m = max(cycle.distance_m, 1e-9)
    stops = sum(standing and first > 0 for first, _, standing in phases(cycle.speed_mps))
    power = speed * accel
    brisk = power[accel > ACCELERATING_MPS2]
    return CycleStatistics(
        duration_s=cycle.duration_s,
        distance_km=cycle.distance_m / 1e3,
        speed_mean_kmh=3.6 * cycle.distance_m / cycle.duration_s,
        speed_max_kmh=3.6 * float(np.max(cycle.speed_mps)),
        stops_per_km=stops / way_m * 1e3,
        standing_percent=100.0 * float(np.mean(speed <= 0.0)),
        rpa_mps2=float(np.sum(power[power > 0.0])) / way_m,
        va_p95_wpkg=float(np.percentile(brisk, 95)) if len(brisk) else 0.0,
        grade_sd_percent=100.0 * float(np.sqrt(np.sum(grade**2 * speed) / way_m)),
        grade_max_percent=100.0 * float(np.max(np.abs(cycle.grade))),
        climb_m_per_km=float(np.sum(np.maximum(grade, 0.0) * speed)) / way_m * 1e3,
    )
