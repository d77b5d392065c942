"""Fuel against instructions: precisions, solvers and iteration counts of the firmware, measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from qpmpc.codegen.generate import Precision, Solver
from qpmpc.codegen.pil import PilResult, processor_in_the_loop
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.report.provenance import provenance
from qpmpc.simulate import Progress, as_fraction
from qpmpc.vehicle.parameters import Vehicle

ITERATIONS = (10, 25, 50, 100)
Job = Callable[[str], Progress]


@dataclass(frozen=True)
class Pareto:
    """Processor-in-the-loop runs of one cycle beside its optimum.

    Attributes
    ----------
    dp_fuel_g : of dynamic programming, the SOC at the end as at the start
    results : one a solver, precision and iteration count
    """

    dp_fuel_g: float
    results: list[PilResult]

    def rows(self) -> list[dict[str, Any]]:
        """Return the figures of each run, fuel above dynamic programming among them."""
        return [
            result.summary()
            | {
                "fuel_above_dp_percent": (result.run.fuel_soc_balanced_g / self.dp_fuel_g - 1.0)
                * 100.0
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
    precisions: Sequence[Precision], solvers: Sequence[Solver], iterations: Sequence[int]
) -> int:
    """Return how many jobs `embedded_pareto` announces."""
    return 1 + len(precisions) * len(solvers) * len(iterations)


def embedded_pareto(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: ControllerSettings,
    precisions: Sequence[Precision],
    solvers: Sequence[Solver],
    next_job: Job,
    iterations: Sequence[int] = ITERATIONS,
) -> Pareto:
    """Run every combination in the loop, one after the other.

    Parameters
    ----------
    cycle, vehicle, settings : the trip; the settings' iterations a step are replaced
    precisions, solvers, iterations : of the firmware
    next_job : announces a job and returns where it reports its progress, see `job_count`

    Raises
    ------
    CodegenError
        If a tool is missing, a firmware does not fit or does not answer.
    InputError
        If the settings do not fit generated code.
    """
    from qpmpc.verification.dynamic_programming import solve_dp

    report = next_job(f"{cycle.name}, dynamic programming")
    optimum = solve_dp(cycle, vehicle, settings.dp, as_fraction(report))
    results = []
    for solver, precision, count in product(solvers, precisions, iterations):
        chosen = settings.with_settings({"mh_qp.osqp.iterations": count})
        report = next_job(f"{cycle.name}, {solver} {precision} K = {count}")
        results.append(processor_in_the_loop(cycle, vehicle, chosen, precision, report, solver))
    return Pareto(float(optimum.fuel_g.sum()), results)
