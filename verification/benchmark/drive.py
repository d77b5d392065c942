"""One candidate drives one cycle with its own solutions: fuel and times."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from qpmpc.closed_loop import drive as drive_trip
from qpmpc.codegen.controller import GeneratedController
from qpmpc.controllers.qp_planner import QpPlanner, Solve
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.registry import make_controller
from qpmpc.results import Run
from qpmpc.solvers.base import Floats
from qpmpc.solvers.names import make_solver
from qpmpc.trip import Trip
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE, Candidate

ENOUGH_MS = 10e3  # of decisions: no further repetition after that


@dataclass(frozen=True)
class Drive:
    """Result of one candidate on one cycle.

    Attributes
    ----------
    run : the last repetition
    step_ms, solve_ms, update_ms, own_ms : every step of every repetition, ms, shape
        (repetitions, steps); the last by the solver's own clock. Without values where the
        candidate does not have it
    """

    candidate: Candidate
    run: Run
    step_ms: Floats
    solve_ms: Floats
    update_ms: Floats
    own_ms: Floats
    stages: int | None

    def row(self, dp_fuel_g: float) -> dict[str, Any]:
        """Return the figures as plain data."""
        summary = self.run.summary()
        balanced = summary["fuel_soc_balanced_g"]
        cycle_s = float(self.step_ms.min(axis=0).sum() / 1e3)
        return {
            "cycle": self.run.cycle,
            "candidate": self.candidate.label,
            "family": self.candidate.family,
            "stages": self.stages,
            "repetitions": len(self.step_ms),
            "fuel_soc_balanced_g": balanced,
            "comparable": summary["comparable"],
            "fuel_above_dp_percent": 100.0 * (balanced / dp_fuel_g - 1.0),
            "violations": summary["violations"],
            "fallback_steps": summary["fallback_steps"],
            "iterations_median": summary["solver"]["iterations_median"],
            "iterations_max": summary["solver"]["iterations_max"],
            "step_time_ms": spread(self.step_ms),
            "solve_time_ms": spread(self.solve_ms),
            "update_time_ms": spread(self.update_ms),
            "own_time_ms": spread(self.own_ms),
            "cycle_time_s": cycle_s if np.isfinite(cycle_s) else None,
        }


def spread(times_ms: Floats) -> dict[str, float] | None:
    """Median, p99 and worst step, of the best that each step took over the repetitions.

    Repetitions solve the same problems, so that what one step takes more than in another
    repetition is the machine's. None without values.
    """
    if not times_ms.size or not np.isfinite(times_ms).all():
        return None
    best = times_ms.min(axis=0)
    return {
        "median": float(np.median(best)),
        "p99": float(np.percentile(best, 99)),
        "max": float(best.max()),
    }


def drive(
    candidate: Candidate, trip: Trip, repetitions: int, settings: ControllerSettings | None = None
) -> Drive:
    """Drive a trip with a candidate `repetitions` times, or fewer if that takes long.

    Backends with their own iteration limit may need many seconds per cycle; they are driven in
    full all the same, since a benchmark of one step says nothing about a closed loop.
    """
    settings = (settings or ControllerSettings()).with_settings(candidate.overrides)
    steps: list[Floats] = []
    solves, updates, owns = [], [], []
    stages: int | None = None
    for _ in range(repetitions):
        if sum(map(np.sum, steps)) > ENOUGH_MS:
            break
        solve_s: list[float] = []
        update_s: list[float] = []
        own_s: list[float] = []

        if candidate.whole:
            run = drive_trip(trip, make_controller(candidate.controller, trip, settings))
        elif candidate.generated:
            in_c = GeneratedController(trip, settings)
            stages = in_c.library.values.sizes.stages

            def watch(*_: object, driver: GeneratedController = in_c) -> None:
                solve_s.append(driver.call_s)  # noqa: B023
                update_s.append(driver.fill_s)  # noqa: B023

            run = drive_trip(trip, in_c, on_step=watch)
        else:

            def keep(solve: Solve) -> None:
                if not solve.cold:
                    solve_s.append(solve.solution.solve_s)  # noqa: B023
                    update_s.append(solve.solution.update_s)  # noqa: B023
                    own_s.append(solve.solution.own_s)  # noqa: B023

            planner = _planner(candidate, trip, settings, keep)
            stages = planner.preview.count
            run = drive_trip(trip, RecedingHorizon(trip, planner))
        steps.append(run.trajectory.step_time_s * 1e3)
        solves.append(np.array(solve_s) * 1e3)
        updates.append(np.array(update_s) * 1e3)
        owns.append(np.array(own_s) * 1e3)
    step_ms, solve_ms, update_ms, own_ms = map(np.array, (steps, solves, updates, owns))
    return Drive(candidate, run, step_ms, solve_ms, update_ms, own_ms, stages)


def _planner(
    candidate: Candidate, trip: Trip, settings: ControllerSettings, keep: Callable[[Solve], None]
) -> QpPlanner:
    is_ours = candidate.controller == "mh-qp"
    return QpPlanner(
        trip,
        settings,
        settings.mh_qp if is_ours else settings.mh_qp_paper,
        name=candidate.controller,
        solver=make_solver(candidate.solver, RIVAL_TOLERANCE) if candidate.solver else None,
        on_solve=keep,
    )
