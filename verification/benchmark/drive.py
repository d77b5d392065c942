"""One candidate drives one cycle with its own answers; what it burnt and how long it took."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from qpmpc.codegen import GeneratedController, generated_controller
from qpmpc.controllers.base import Controller, Decision, Observation
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.results import Run
from qpmpc.simulate import Progress, simulate
from qpmpc.solvers.base import Floats, QpSolution, QpSolver
from qpmpc.solvers.osqp import Osqp
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant
from qpmpc.verification.benchmark.candidates import Candidate

ENOUGH_MS = 10e3  # of deciding: no further repetition then


class Stopwatch:
    """Passes QPs on to a backend and keeps its times, departure left out."""

    def __init__(self, solver: QpSolver) -> None:
        self.name = solver.name
        self.solve_s: list[float] = []
        self.update_s: list[float] = []
        self._solver = solver

    def setup(self, structure: QpStructure, data: QpData) -> None:
        """Pass on."""
        self._solver.setup(structure, data)

    def solve(
        self, data: QpData, z: Floats | None, y: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Pass on, and keep the times."""
        solution = self._solver.solve(data, z, y, cold)
        if not cold:
            self.solve_s.append(solution.solve_s)
            self.update_s.append(solution.update_s)
        return solution


class CallWatch:
    """Drives by a generated controller and keeps its times: the C call, and filling its input."""

    def __init__(self, controller: GeneratedController) -> None:
        self.name, self.solver_name = controller.name, controller.solver_name
        self.solve_s: list[float] = []
        self.update_s: list[float] = []
        self._controller = controller

    def decide(self, seen: Observation) -> Decision:
        """Pass on, and keep the times."""
        start = perf_counter()
        self._controller.fill(seen)
        filled = perf_counter()
        decision = self._controller.step()
        self.solve_s.append(perf_counter() - filled)
        self.update_s.append(filled - start)
        return decision


@dataclass(frozen=True)
class Drive:
    """Result of one candidate on one cycle.

    Attributes
    ----------
    run : the last repetition
    step_ms, solve_ms, update_ms : every step of every repetition, ms, shape (repetitions, steps)
    """

    candidate: Candidate
    run: Run
    step_ms: Floats
    solve_ms: Floats
    update_ms: Floats
    stages: int

    def row(self, dp_fuel_g: float) -> dict[str, Any]:
        """Return the figures as plain data; a maximum is the median of the repetitions' maxima."""
        summary = self.run.summary()
        balanced = summary["fuel_soc_balanced_g"]
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
            "cycle_time_s": float(np.median(self.step_ms.sum(axis=1)) / 1e3),
        }


def spread(times_ms: Floats) -> dict[str, float]:
    """Median and p99 over all steps; max: the median over repetitions of the worst step."""
    return {
        "median": float(np.median(times_ms)),
        "p99": float(np.percentile(times_ms, 99)),
        "max": float(np.median(times_ms.max(axis=1))),
    }


def drive(
    candidate: Candidate,
    cycle: Cycle,
    vehicle: Vehicle,
    repetitions: int,
    progress: Progress | None = None,
) -> Drive:
    """Let a candidate drive a cycle `repetitions` times, or fewer if that takes long.

    Backends with an iteration limit of their own may need many seconds a cycle; they are driven
    in full all the same, since a benchmark of one step says nothing about a closed loop.
    """
    settings = ControllerSettings().with_settings(candidate.overrides)
    steps: list[Floats] = []
    solves, updates = [], []
    for repetition in range(repetitions):
        if sum(map(np.sum, steps)) > ENOUGH_MS:
            break
        controller, watch, stages = _started(candidate, cycle, vehicle, settings)

        def report(done: int, total: int, before: int = repetition) -> None:
            if progress is not None:
                progress(before * total + done, repetitions * total)

        run = simulate(cycle, controller, vehicle, progress=report)
        steps.append(run.trajectory.step_time_s * 1e3)
        solves.append(np.array(watch.solve_s) * 1e3)
        updates.append(np.array(watch.update_s) * 1e3)
    return Drive(candidate, run, np.array(steps), np.array(solves), np.array(updates), stages)


def _started(
    candidate: Candidate, cycle: Cycle, vehicle: Vehicle, settings: ControllerSettings
) -> tuple[Controller, "Stopwatch | CallWatch", int]:
    """Make the controller of one trip, its departure done, and what times it."""
    plant, truth = Plant(vehicle), Trace.of(cycle, vehicle)
    if candidate.generated:
        made = generated_controller(plant, truth, settings=settings)
        calls = CallWatch(made)
        return calls, calls, made.library.values.sizes.stages
    chosen = settings.mh_qp if candidate.controller == "mh-qp" else settings.mh_qp_paper
    backend = Osqp(chosen.osqp) if candidate.solver is None else candidate.solver()
    watch = Stopwatch(backend)
    controller = MhQp(candidate.controller, plant, truth, truth, chosen, settings.rule_based, watch)
    return controller, watch, controller.planner.preview.count
