"""Closed loops of every variant on every cycle and vehicle, judged against DP."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.simulation import simulate
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.dynamic_programming import solve_dp
from qpmpc.verification.study.variants import Variant


@dataclass(frozen=True)
class Place:
    """A cycle and a vehicle, ambient included, with the fuel of DP."""

    cycle: Cycle
    vehicle: Vehicle
    dp_fuel_g: float

    @property
    def label(self) -> str:
        """Name in tables."""
        return f"{self.cycle.name}, {self.vehicle.name}, {self.vehicle.thermal.t_amb_degc:g} C"


def places(cycles: Sequence[Cycle], vehicles: Sequence[Vehicle]) -> list[Place]:
    """Solve DP for every cycle and vehicle (cached on disk)."""
    return [
        Place(cycle, vehicle, float(solve_dp(cycle, vehicle).fuel_g.sum()))
        for cycle in cycles
        for vehicle in vehicles
    ]


def judge(variant: Variant, where: Sequence[Place]) -> dict[str, Any]:
    """Drive every place with one variant.

    Returns
    -------
    fuel above DP in percent for each place, its mean and maximum, the places where a limit was
    violated, and the median step time over all places
    """
    overrides = {f"mh_qp.{key}": value for key, value in variant.overrides.items()}
    settings = ControllerSettings().with_settings(overrides)
    above, violated, integral, times = {}, [], [], []
    for place in where:
        run = simulate(place.cycle, "mh-qp", place.vehicle, settings=settings)
        summary = run.summary()
        above[place.label] = 100.0 * (run.fuel_soc_balanced_g / place.dp_fuel_g - 1.0)
        if any(excess > 0.0 for excess in summary["violations"].values()):
            violated.append(place.label)
        integral.append(summary["sigma_integral_share"])
        times.append(summary["step_time_ms"]["median"])
    values = list(above.values())
    return {
        "group": variant.group,
        "label": variant.label,
        "overrides": variant.overrides,
        "above_dp_percent": above,
        "mean_percent": float(np.mean(values)),
        "max_percent": float(np.max(values)),
        "violated": violated,
        "sigma_integral_share": float(np.mean(integral)),
        "step_ms": float(np.median(times)),
    }


def study(
    chosen: Sequence[Variant], where: Sequence[Place], done: Callable[[], None]
) -> list[dict[str, Any]]:
    """Judge every variant; `done` is called after each."""
    rows = []
    for variant in chosen:
        rows.append(judge(variant, where))
        done()
    return rows
