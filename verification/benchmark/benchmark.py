"""The whole benchmark: candidates on cycles, growth, figures as plain data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Any

from qpmpc.controllers.base import Progress
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.pool import in_order
from qpmpc.report.provenance import provenance
from qpmpc.trip import Trip
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE, Candidate, missing
from qpmpc.verification.benchmark.drive import Drive, drive
from qpmpc.verification.benchmark.growth import growth
from qpmpc.verification.benchmark.on_samples import cold_and_warm, generated, stopped
from qpmpc.verification.benchmark.sampled import samples
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp
from qpmpc.verification.dynamic_programming.controller import as_fraction

REPETITIONS = 3
SAMPLES = 40
Job = Callable[[str], Progress]


@dataclass(frozen=True)
class Benchmark:
    """Results of a benchmark.

    Attributes
    ----------
    drives : one per candidate and cycle
    rows : their figures, in the same order
    growth : one row per number of stages
    solvers : one row per rival and start, on QPs sampled from the first trip
    anytime : one row per solver and number of iterations it is stopped at, on the same QPs
    missing : rivals whose package is not installed
    """

    drives: list[Drive]
    rows: list[dict[str, Any]]
    growth: list[dict[str, Any]]
    solvers: list[dict[str, Any]] = field(default_factory=list)
    anytime: list[dict[str, Any]] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data, ready for JSON."""
        return {
            "runs": self.rows,
            "solvers": self.solvers,
            "anytime": self.anytime,
            "growth": self.growth,
            "missing_rivals": self.missing,
            "rival_tolerance": RIVAL_TOLERANCE,
            "repetitions": REPETITIONS,
            "provenance": provenance(),
        }


def jobs(trips: Sequence[Trip]) -> int:
    """Return the number of jobs that `benchmark` announces."""
    return 2 * len(trips) + 3


def benchmark(
    trips: Sequence[Trip],
    chosen: Sequence[Candidate],
    next_job: Job,
    settings: ControllerSettings | None = None,
    sampled: int = SAMPLES,
) -> Benchmark:
    """Drive every trip with every candidate, one after the other in one process of their own.

    Parameters
    ----------
    trips : all with one vehicle
    chosen : candidates
    next_job : announces a job and returns the function for its progress; called `jobs` times
    settings : of all controllers
    sampled : QPs of the first trip on which the rivals among the candidates are compared
    """
    settings = settings or ControllerSettings()
    drives, rows = [], []
    for trip in trips:
        name = trip.cycle.name
        report = next_job(f"{name}, dynamic programming")
        grid = settings.of("dp", DpSettings())
        solution = solve_dp(trip.cycle, trip.vehicle, grid, as_fraction(report))
        dp_fuel_g = float(solution.fuel_g.sum())
        report = next_job(f"{name}, {len(chosen)} candidates")
        # in one process of their own, where nothing but the candidate runs
        driven = in_order(partial(_drive, trip, settings), chosen, report, count=1)
        drives += driven
        rows += [each.row(dp_fuel_g) for each in driven]
    rivals = [each.solver for each in chosen if each.solver]
    report = next_job(f"{len(rivals)} solvers, cold and warm")
    qps = samples(trips[0], settings, sampled)
    solved = in_order(partial(cold_and_warm, qps), rivals, report, count=1)
    report = next_job("solvers stopped early")
    early = in_order(partial(stopped, qps), ["osqp", *rivals], report, count=1)
    anytime = [*chain(*early)]
    ours = generated([row for row in rows if row["cycle"] == trips[0].cycle.name], anytime)
    report = next_job("growth over stages")
    grown = growth(trips[0].vehicle, settings.mh_qp, rivals)
    report(1, 1)
    return Benchmark(drives, rows, grown, [*chain(*solved)], [*ours, *anytime], missing())


def _drive(trip: Trip, settings: ControllerSettings, candidate: Candidate) -> Drive:
    return drive(candidate, trip, REPETITIONS, settings)
