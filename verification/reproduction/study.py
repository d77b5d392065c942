"""Everything that is run: closed loops, dynamic programming, experiments, wrong forecasts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from qpmpc.comparison import compare_runs
from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.factory import ControllerSettings, make_controller
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.planner import Plan
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.results import Run
from qpmpc.runners import run as run_one
from qpmpc.simulate import simulate
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant
from qpmpc.verification.dynamic_programming import DpSolution, solve_dp
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
        """Start a job; returns what it calls as report(done, in all)."""


@dataclass(frozen=True)
class Snapshot:
    """The plan of one step, with the road as it really is.

    Attributes
    ----------
    label : controller
    step : time step
    plan : its QP's solution
    truth : the whole trip
    """

    label: str
    step: int
    plan: Plan
    truth: Trace


@dataclass(frozen=True)
class Study:
    """Results of a reproduction.

    Attributes
    ----------
    vehicle, settings, extent : what was run
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

        m - lambda (SOC_end - SOC_init) - m_dp, with lambda the costate of the final SOC: the
        least fuel is convex in the final SOC, so this is a lower bound of the distance from the
        optimum that ends where the run ended. Fixed efficiencies are no such bound.
        """
        run, best = self.runs[cycle, label], self.optima[cycle]
        surplus = float(run.trajectory.soc[-1]) - float(best.soc[-1])
        return run.fuel_g - float(best.soc_costate_g[-1]) * surplus - best.fuel_total_g


def job_count(extent: Extent) -> int:
    """Number of jobs that `run_study` reports."""
    a_cycle = len(VARIANTS) + 1  # and the forecasts
    return len(extent.all_cycles) * a_cycle + len(extent.cycles) * len(EXPERIMENTS) + 1


def run_study(vehicle: Vehicle, settings: ControllerSettings, extent: Extent, jobs: Jobs) -> Study:
    """Run everything; one closed loop after the other, so that step times are not disturbed.

    Parameters
    ----------
    vehicle, settings : user's overrides included
    extent : which cycles, how many forecasts
    jobs : told of each job; there are `job_count(extent)`
    """
    if extent.dp is not None:
        settings = settings.model_copy(update={"dp": extent.dp})

    def drive(cycle: Cycle, variant: Variant) -> Run:
        report = jobs.next_job(f"{cycle.name}, {variant.label}")
        chosen = settings.with_settings(variant.settings)
        run = run_one(cycle, variant.controller, vehicle, chosen, report)
        return replace(run, controller=variant.label)

    runs = {
        (cycle.name, variant.label): drive(cycle, variant)
        for cycle in extent.all_cycles
        for variant in VARIANTS
    }
    tried = {
        (cycle.name, variant.label): drive(cycle, variant)
        for cycle in extent.cycles
        for variant in EXPERIMENTS
    }
    measures = [run for (_, label), run in runs.items() if label in (RULES, OPTIMUM)]
    jobs.next_job("horizons")
    first = extent.cycles[0]
    snapshots = tuple(
        _snapshot(first, label, vehicle, settings, extent.snapshot_step)
        for label in (PAPER_GRID, OURS)
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
        optima={c.name: solve_dp(c, vehicle, settings.dp) for c in extent.all_cycles},
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


class _Watch:
    """A controller that is watched: keeps its plan of one step."""

    solver_name = ""

    def __init__(self, controller: MhQp, step: int) -> None:
        self.name = controller.name
        self._controller, self._step = controller, step
        self.plan: Plan | None = None

    def decide(self, seen: Observation) -> Decision:
        decision = self._controller.decide(seen)
        if seen.step == self._step:
            self.plan = self._controller.planner.plan
        return decision


def _snapshot(
    cycle: Cycle, label: str, vehicle: Vehicle, settings: ControllerSettings, step: int
) -> Snapshot:
    truth = Trace.of(cycle, vehicle)
    settings = settings.with_settings({"mh_qp.solver": "osqp"})  # whose plan can be looked at
    controller = make_controller(label, Plant(vehicle), truth, settings=settings)
    if not isinstance(controller, MhQp):
        raise TypeError(f"{label} has no horizon to show")
    watch = _Watch(controller, step)
    simulate(cycle, watch, vehicle)
    if watch.plan is None:
        raise RuntimeError(f"{label} has no plan at step {step}")
    return Snapshot(label, step, watch.plan, truth)
