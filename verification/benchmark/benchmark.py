"""The whole benchmark: candidates on cycles, growth, figures as plain data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from qpmpc.controllers.base import Progress
from qpmpc.pool import in_order
from qpmpc.report.provenance import provenance
from qpmpc.trip import Trip
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE, Candidate
from qpmpc.verification.benchmark.drive import Drive, drive
from qpmpc.verification.benchmark.growth import growth
from qpmpc.verification.dynamic_programming import solve_dp
from qpmpc.verification.dynamic_programming.controller import as_fraction

REPETITIONS = 3
Job = Callable[[str], Progress]


@dataclass(frozen=True)
class Benchmark:
    """Results of a benchmark.

    Attributes
    ----------
    drives : one per candidate and cycle
    rows : their figures, in the same order
    growth : one row per number of stages
    """

    drives: list[Drive]
    rows: list[dict[str, Any]]
    growth: list[dict[str, Any]]

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data, ready for JSON."""
        return {
            "runs": self.rows,
            "growth": self.growth,
            "rival_tolerance": RIVAL_TOLERANCE,
            "repetitions": REPETITIONS,
            "provenance": provenance(),
        }


def benchmark(trips: Sequence[Trip], chosen: Sequence[Candidate], next_job: Job) -> Benchmark:
    """Drive every trip with every candidate, one after the other in one process of their own.

    Parameters
    ----------
    trips : all with one vehicle
    chosen : candidates
    next_job : announces a job and returns the function for its progress; called
        2 len(trips) + 1 times
    """
    drives, rows = [], []
    for trip in trips:
        name = trip.cycle.name
        report = next_job(f"{name}, dynamic programming")
        solution = solve_dp(trip.cycle, trip.vehicle, progress=as_fraction(report))
        dp_fuel_g = float(solution.fuel_g.sum())
        report = next_job(f"{name}, {len(chosen)} candidates")
        # in one process of their own, where nothing but the candidate runs
        driven = in_order(partial(_drive, trip), chosen, report, count=1)
        drives += driven
        rows += [each.row(dp_fuel_g) for each in driven]
    report = next_job("growth over stages")
    grown = growth(trips[0].vehicle)
    report(1, 1)
    return Benchmark(drives, rows, grown)


def _drive(trip: Trip, candidate: Candidate) -> Drive:
    return drive(candidate, trip, REPETITIONS)
