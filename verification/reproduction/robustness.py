"""Closed loop under wrong forecasts: many seeded trips, in processes."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.pool import in_order
from qpmpc.preview.forecast_errors import MODELS, forecast
from qpmpc.results import Run
from qpmpc.simulation import simulate
from qpmpc.vehicle.parameters import Vehicle

CONTROLLER = "mh-qp"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ForecastRun:
    """One trip with a wrong forecast of it.

    Attributes
    ----------
    cycle, model, seed : which forecast
    loss_percent : balanced fuel above that of the same controller with the true forecast
    soc_end, t_cl_min_degc, t_cl_max_degc : of the trip
    soc_violation, t_cl_violation_k, power_violation_w : largest excess over each limit
    fallback_steps : steps that the optimiser did not drive
    """

    cycle: str
    model: str
    seed: int
    loss_percent: float
    soc_end: float
    t_cl_min_degc: float
    t_cl_max_degc: float
    soc_violation: float
    t_cl_violation_k: float
    power_violation_w: float
    fallback_steps: int

    @property
    def violates(self) -> bool:
        """Whether any limit was exceeded."""
        return max(self.soc_violation, self.t_cl_violation_k, self.power_violation_w) > 0.0


Job = tuple[Cycle, Vehicle, ControllerSettings, str, int, float]


def run_forecasts(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: ControllerSettings,
    perfect: Run,
    seeds: int,
    progress: Progress,
) -> list[ForecastRun]:
    """Drive a cycle with `mh-qp` under every error model, `seeds` times each.

    Parameters
    ----------
    perfect : run of the same controller with the true forecast
    progress : called as progress(done, in all)
    """
    fuel_g = perfect.fuel_soc_balanced_g
    jobs = [(cycle, vehicle, settings, *key, fuel_g) for key in product(MODELS, range(seeds))]
    return in_order(_one, jobs, progress)


def _one(job: Job) -> ForecastRun:
    cycle, vehicle, settings, model, seed, perfect_g = job
    guess = forecast(cycle, vehicle, model, seed)
    run = simulate(cycle, CONTROLLER, vehicle, settings=settings, forecast=guess)
    found = run.summary()
    return ForecastRun(
        cycle=cycle.name,
        model=model,
        seed=seed,
        loss_percent=100.0 * (run.fuel_soc_balanced_g / perfect_g - 1.0),
        soc_end=found["soc_end"],
        t_cl_min_degc=found["t_cl_min_degc"],
        t_cl_max_degc=found["t_cl_max_degc"],
        soc_violation=found["violations"]["soc"],
        t_cl_violation_k=found["violations"]["t_cl_degc"],
        power_violation_w=found["violations"]["power_w"],
        fallback_steps=found["fallback_steps"],
    )


def mean_loss_percent(runs: list[ForecastRun]) -> float:
    """Mean loss over runs."""
    return float(np.mean([run.loss_percent for run in runs]))
