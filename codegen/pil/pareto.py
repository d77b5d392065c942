"""Fuel against instructions: precisions, algorithms and iterations of the firmware, measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from qpmpc.closed_loop import drive
from qpmpc.codegen.generate import Algorithm, Precision
from qpmpc.codegen.pil.loop import PilResult, processor_in_the_loop
from qpmpc.controllers.base import Progress
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.report.provenance import provenance
from qpmpc.results import Run, balanced_g
from qpmpc.trip import Trip
from qpmpc.verification.dynamic_programming.controller import Dp

ITERATIONS = (10, 30, 50, 100)
Job = Callable[[str], Progress]


@dataclass(frozen=True)
class Pareto:
    """Processor-in-the-loop runs of one cycle beside its optimum.

    Attributes
    ----------
    optimum : the run of dynamic programming
    results : one per algorithm, precision and iteration count
    """

    optimum: Run
    results: list[PilResult]

    @property
    def dp_fuel_g(self) -> float:
        """Fuel of dynamic programming, its final SOC priced as that of all."""
        return balanced_g(self.optimum, self.optimum)

    def rows(self) -> list[dict[str, Any]]:
        """Return the figures of each run, including fuel above dynamic programming."""
        return [
            result.summary()
            | {
                "fuel_above_dp_percent": 100.0
                * (balanced_g(result.run, self.optimum) / self.dp_fuel_g - 1.0)
            }
            for result in self.results
        ]

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data, ready for JSON."""
        return {
            "dp_fuel_g": self.dp_fuel_g,
            "runs": self.rows(),
            "provenance": provenance(),
        }


def job_count(
    precisions: Sequence[Precision], algorithms: Sequence[Algorithm], iterations: Sequence[int]
) -> int:
    """Return how many jobs `embedded_pareto` announces."""
    return 1 + len(precisions) * len(algorithms) * len(iterations)


def embedded_pareto(
    trip: Trip,
    settings: ControllerSettings,
    precisions: Sequence[Precision],
    algorithms: Sequence[Algorithm],
    next_job: Job,
    iterations: Sequence[int] = ITERATIONS,
) -> Pareto:
    """Run every combination in the loop, one after the other.

    Parameters
    ----------
    trip, settings : as of `processor_in_the_loop`; iterations per step are replaced
    precisions, algorithms, iterations : of the firmware
    next_job : announces a job and returns the function for its progress, see `job_count`

    Raises
    ------
    CodegenError
        If a tool is missing, a firmware does not fit or does not answer.
    InputError
        If the settings do not fit generated code.
    """
    name = trip.cycle.name
    report = next_job(f"{name}, dynamic programming")
    optimum = drive(trip, Dp(trip, settings), progress=report)
    results = []
    for algorithm, precision, count in product(algorithms, precisions, iterations):
        chosen = settings.with_settings({"mh_qp.admm.iterations": count})
        report = next_job(f"{name}, {algorithm} {precision} K = {count}")
        results.append(processor_in_the_loop(trip, chosen, precision, report, algorithm))
    return Pareto(optimum, results)
