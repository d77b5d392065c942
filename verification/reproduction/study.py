"""All runs: closed loops, dynamic programming, experiments, wrong forecasts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from qpmpc.closed_loop import drive
from qpmpc.controllers.base import Decision
from qpmpc.controllers.qp_planner import QpPlan, QpPlanner
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.results import Run, compare_runs
from qpmpc.simulation import simulate
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.dynamic_programming import DpSettings, DpSolution, solve_dp
from qpmpc.verification.reproduction.robustness import ForecastRun, run_forecasts
from qpmpc.verification.reproduction.variants import (
    EXPERIMENTS,
    OPTIMUM,
    OURS,
    PAPER_GRID,
    RULES,
    VARIANTS,
    Extent,
    Variant,
)

Row = dict[str, Any]
Report = Callable[[int, int], None]


class Jobs(Protocol):
    """A progress bar over jobs."""

    def next_job(self, title: str) -> Report:
        """Start a job; returns the function to call as report(done, in all)."""


@dataclass(frozen=True)
class Snapshot:
    """The plan of one step, with the true trip.

    Attributes
    ----------
    label : controller
    step : time step
    plan : its QP's solution
    truth : the whole trip
    """

    label: str
    step: int
    plan: QpPlan
    truth: Trace


@dataclass(frozen=True)
class Study:
    """Results of a reproduction.

    Attributes
    ----------
    vehicle, settings, extent : of the runs
    runs : by (cycle, label)
    rows : their figures, with savings and distances from dynamic programming
    optima : dynamic programming by cycle
    experiments : figures of the experiments, likewise; `rule` and `dp` runs are not repeated
    forecasts : runs with wrong forecasts
    snapshots : horizons of one step
    """

    vehicle: Vehicle
    settings: ControllerSettings
    extent: Extent
    runs: dict[tuple[str, str], Run]
    rows: dict[tuple[str, str], Row]
    optima: dict[str, DpSolution]
    experiments: dict[tuple[str, str], Row]
    forecasts: list[ForecastRun]
    snapshots: tuple[Snapshot, ...]

    def above_optimum_g(self, cycle: str, label: str) -> float:
        """Fuel above dynamic programming with the final SOC at dynamic programming's own price.

        m - lambda (SOC_end - SOC_dp) - m_dp, with lambda the price of SOC: the least fuel is
        convex in the final SOC, so this is a lower bound of the distance from the optimum that
        ends where the run ended. Fixed efficiencies do not give such a bound. The price is that
        of departure: it hardly changes on the way, and near arrival, where dynamic programming
        has few choices left, the one found there is off by up to a few percent.
        """
        run, best = self.runs[cycle, label], self.optima[cycle]
        surplus = float(run.trajectory.soc[-1]) - float(best.soc[-1])
        return run.fuel_g - float(best.soc_costate_g[0]) * surplus - best.fuel_total_g


def job_count(extent: Extent) -> int:
    """Number of jobs that `run_study` reports."""
    a_cycle = len(VARIANTS) + 1  # and the forecasts
    return len(extent.all_cycles) * a_cycle + len(extent.cycles) * len(EXPERIMENTS) + 1


def run_study(vehicle: Vehicle, settings: ControllerSettings, extent: Extent, jobs: Jobs) -> Study:
    """Run everything; one closed loop after the other, so that step times are not affected.

    Parameters
    ----------
    vehicle, settings : user's overrides included
    extent : which cycles, how many forecasts
    jobs : notified of each job; there are `job_count(extent)`
    """
    if extent.dp is not None:
        settings = settings.with_section("dp", extent.dp)

    grid = settings.of("dp", DpSettings())

    def run_variant(cycle: Cycle, variant: Variant) -> Run:
        report = jobs.next_job(f"{cycle.name}, {variant.label}")
        chosen = settings.with_settings(variant.settings)
        run = simulate(cycle, variant.controller, vehicle, settings=chosen, progress=report)
        return replace(run, controller=variant.label)

    runs = {
        (cycle.name, variant.label): run_variant(cycle, variant)
        for cycle in extent.all_cycles
        for variant in VARIANTS
    }
    tried = {
        (cycle.name, variant.label): run_variant(cycle, variant)
        for cycle in extent.cycles
        for variant in EXPERIMENTS
    }
    measures = [run for (_, label), run in runs.items() if label in (RULES, OPTIMUM)]
    jobs.next_job("horizons")
    first = Trip(extent.cycles[0], vehicle)
    snapshots = tuple(
        _snapshot(first, label, settings, extent.snapshot_step) for label in (PAPER_GRID, OURS)
    )
    forecasts = []
    for cycle in extent.all_cycles:
        report = jobs.next_job(f"{cycle.name}, wrong forecasts")
        perfect = runs[cycle.name, OURS]
        forecasts += run_forecasts(cycle, vehicle, settings, perfect, extent.seeds, report)
    return Study(
        vehicle=vehicle,
        settings=settings,
        extent=extent,
        runs=runs,
        rows=_rows([*runs.values()]),
        optima={c.name: solve_dp(c, vehicle, grid) for c in extent.all_cycles},
        experiments={
            key: row for key, row in _rows([*tried.values(), *measures]).items() if key in tried
        },
        forecasts=forecasts,
        snapshots=snapshots,
    )


def _rows(runs: list[Run]) -> dict[tuple[str, str], Row]:
    rows = {}
    for run, row in zip(runs, compare_runs(runs), strict=True):
        times_s = run.trajectory.step_time_s
        row["step_time_ms"]["mean"] = (
            None if np.isnan(times_s).all() else float(np.mean(times_s)) * 1e3
        )
        rows[run.cycle, run.controller] = row
    return rows


def _snapshot(trip: Trip, label: str, settings: ControllerSettings, step: int) -> Snapshot:
    of_qp = settings.mh_qp if label == OURS else settings.mh_qp_paper
    planner = QpPlanner(trip, settings, of_qp, name=label)
    plans: list[QpPlan] = []

    def keep(seen: Observation, _: Decision) -> None:
        if seen.step == step and planner.last is not None:
            plans.append(planner.last)

    drive(trip, RecedingHorizon(trip, planner), on_step=keep)
    if not plans:
        raise RuntimeError(f"{label} has no plan at step {step}")
    return Snapshot(label, step, plans[0], trip.truth)
