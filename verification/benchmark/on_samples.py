"""Solvers on the same sampled QPs: cold and warm, whole call and own clock, error for time.

Every time is the best of `REPEATS`, QP by QP: what remains is the solver's, not the machine's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from qpmpc.solvers.base import Floats, QpSolution, QpSolver, Status
from qpmpc.solvers.names import SOLVERS, make_solver
from qpmpc.solvers.osqp import Osqp
from qpmpc.solvers.settings import AdmmSettings
from qpmpc.solvers.timed import TimedSolver
from qpmpc.verification.benchmark.candidates import GENERATED, RIVAL_TOLERANCE
from qpmpc.verification.benchmark.sampled import Sample

REPEATS = 5
ENOUGH_S = 15.0  # for one row: fewer samples after that
GOLDEN = 0.6180339887
FIRST_ORDER = (10, 25, 50, 100, 200, 400, 1000)
INTERIOR = (2, 4, 6, 8, 10, 12, 15, 20, 30)
# Iterations at which a solver is stopped. HiGHS and qpOASES then return nothing, DAQP a point far
# from feasible.
CAPS = {
    "osqp": FIRST_ORDER,
    "piqp": INTERIOR,
    "piqp-multistage": INTERIOR,
    "clarabel": INTERIOR,
    "qoco": INTERIOR,
    "hpipm": INTERIOR,
    "qpalm": (5, 10, 20, 40, 80, 160),
    "proxqp": (1, 2, 4, 8, 16),
    "scs": FIRST_ORDER,
}


@dataclass(frozen=True)
class Timed:
    """One QP solved several times.

    Attributes
    ----------
    solution : the last
    solve_ms, own_ms, update_ms : the best
    """

    sample: Sample
    solution: QpSolution
    solve_ms: float
    own_ms: float
    update_ms: float


def cold_and_warm(samples: Sequence[Sample], name: str) -> list[dict[str, Any]]:
    """Return a row for each start that a solver knows, at `RIVAL_TOLERANCE`."""
    rows = []
    for warm in (False, True) if starts_warm(name) else (False,):
        timed = _solve(make_solver(name, RIVAL_TOLERANCE), samples, warm)
        rows.append({"solver": name, "start": "warm" if warm else "cold", **_figures(timed)})
    return rows


def stopped(samples: Sequence[Sample], name: str) -> list[dict[str, Any]]:
    """Return a row for each number of iterations that a solver is stopped at; warm if it can be."""
    warm = name == "osqp" or starts_warm(name)
    rows = []
    for cap in CAPS.get(name, ()):
        if name == "osqp":
            solver: QpSolver = Osqp(AdmmSettings(iterations=cap))
        else:
            solver = make_solver(name, RIVAL_TOLERANCE, cap)
        timed = _solve(solver, samples, warm)
        start = "warm" if warm else "cold"
        rows.append({"solver": name, "start": start, "iterations": cap, **_figures(timed)})
        if name != "osqp" and rows[-1]["solved"] == rows[-1]["qps"]:
            break  # it ends before more
    return rows


def generated(
    runs: Sequence[dict[str, Any]], early: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return rows of generated C stopped at K, as far as they can be had.

    It takes no QP from outside. Its times are those of its calls on a trip, data update and all the
    rest of the controller included; its errors are OSQP's at the same K, whose arithmetic it has.

    Parameters
    ----------
    runs : of one trip
    early : rows of `stopped`
    """
    osqp = {row["iterations"]: row for row in early if row["solver"] == "osqp"}
    rows = []
    for run in runs:
        k = run["iterations_max"]
        if run["family"] == GENERATED and k in osqp:
            times = {key: run[key] for key in ("solve_time_ms", "own_time_ms", "update_time_ms")}
            rows.append({**osqp[k], "solver": "generated C", **times, "errors_of": "osqp"})
    return rows


def starts_warm(name: str) -> bool:
    """Whether a backend makes use of a start."""
    kind = SOLVERS.find(name)
    return isinstance(kind, type) and issubclass(kind, TimedSolver) and kind.starts_warm


def _solve(solver: QpSolver, samples: Sequence[Sample], warm: bool) -> list[Timed]:
    """Solve samples, spread evenly, until `ENOUGH_S` is spent."""
    done: list[Timed] = []
    spent = 0.0
    solver.setup(samples[0].structure, samples[0].now.data)
    for sample in _spread(samples):
        best = np.full(3, np.inf)
        for _ in range(REPEATS):
            now, before = sample.now, sample.before
            if warm:
                spent += solver.solve(before.data, before.primal, before.dual).solve_s
                solution = solver.solve(now.data, now.primal, now.dual)
            else:
                solution = solver.solve(now.data, None, None)
            times = 1e3 * np.array([solution.solve_s, solution.own_s, solution.update_s])
            best = np.fmin(best, times)
            spent += solution.solve_s
            if spent > ENOUGH_S:
                break
        done.append(Timed(sample, solution, *(float(t) for t in best)))
        if spent > ENOUGH_S:
            break
    return done


def _spread(samples: Sequence[Sample]) -> list[Sample]:
    """All of them in an order whose beginnings are spread over the trip too."""
    return [samples[i] for i in np.argsort([(k * GOLDEN) % 1.0 for k in range(len(samples))])]


def _figures(timed: Sequence[Timed]) -> dict[str, Any]:
    usable = [t for t in timed if t.solution.usable]
    iterations = [t.solution.iterations for t in timed]
    own = np.array([t.own_ms for t in timed])
    return {
        "qps": len(timed),
        "solved": sum(t.solution.status is Status.SOLVED for t in timed),
        "usable": len(usable),
        "iterations_median": float(np.median(iterations)),
        "iterations_max": max(iterations),
        "solve_time_ms": _quantiles(np.array([t.solve_ms for t in timed])),
        "own_time_ms": _quantiles(own) if np.isfinite(own).all() else None,
        "update_time_ms": _quantiles(np.array([t.update_ms for t in timed])),
        "cost_error_g": _errors([abs(t.sample.cost_error_g(t.solution.primal)) for t in usable]),
        "power_error_w": _errors([t.sample.power_error_w(t.solution.primal) for t in usable]),
        "violation": _errors([t.sample.violation(t.solution.primal) for t in usable]),
    }


def _quantiles(times_ms: Floats) -> dict[str, float]:
    return {
        "median": float(np.median(times_ms)),
        "p99": float(np.percentile(times_ms, 99)),
        "max": float(times_ms.max()),
    }


def _errors(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {"median": float(np.median(values)), "max": float(max(values))}
