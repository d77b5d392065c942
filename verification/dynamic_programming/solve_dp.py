"""Entry points: solve with cached results, and the study of convergence."""

import logging
from collections.abc import Callable

from qpmpc.cycles import Cycle
from qpmpc.vehicle import Vehicle
from qpmpc.verification.dynamic_programming import cache
from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solution import DpSolution
from qpmpc.verification.dynamic_programming.threads import default_threads

Progress = Callable[[float], None]
_log = logging.getLogger(__name__)


def solve_dp(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: DpSettings | None = None,
    progress: Progress | None = None,
    use_cache: bool = True,
) -> DpSolution:
    """Find the least fuel on a cycle, and the trajectory that burns it.

    Parameters
    ----------
    cycle : the cycle driven
    vehicle : the plant; `trip` gives the start, and the SOC that the final one must not be below
    settings : grids, `DpSettings()` if None
    progress : called with the finished fraction, 0 to 1
    use_cache : whether to take the result from disk if it is there, and to keep it there; if
        another process is about to store it, that is waited for

    Raises
    ------
    InputError
        If the trip starts outside the coolant limits, or QPMPC_THREADS is no number of threads.
    QpmpcError
        If numba is not installed.
    """
    settings = settings or DpSettings()
    report = progress or _ignore
    threads = settings.threads or default_threads()
    if not use_cache:
        return _solve(cycle, vehicle, settings, threads, report)
    key = cache.key(cycle, vehicle, settings)
    known = cache.load(key)
    if known is None:
        with cache.alone(key):
            known = cache.load(key)  # another process may have stored it meanwhile
            if known is None:
                solution = _solve(cycle, vehicle, settings, threads, report)
                cache.store(key, solution)
                return solution
    _log.info("optimum of %s taken from %s", cycle.name, cache.folder())
    report(1.0)
    return known


def _solve(
    cycle: Cycle, vehicle: Vehicle, settings: DpSettings, threads: int, report: Progress
) -> DpSolution:
    # here, so that only solving needs numba
    from qpmpc.verification.dynamic_programming.levels import solve

    return solve(cycle, vehicle, settings, threads, report)


def convergence_study(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: DpSettings | None = None,
    doublings: int = 3,
    progress: Progress | None = None,
    use_cache: bool = True,
) -> tuple[DpSolution, ...]:
    """Solve on tubes of `settings`, then with all their spacings halved `doublings` times.

    Compare the `fuel_total_g` and `gap_g` of the results.

    Parameters
    ----------
    settings : of the first solution; a quarter of the default refinement if None
    doublings : how often to halve

    Raises
    ------
    See `solve_dp`.
    """
    current = settings or DpSettings(refinement=2, power_step_w=2000.0)
    report = progress or _ignore
    solutions = []
    done, total = 0.0, float(sum(8**i for i in range(doublings + 1)))
    for i in range(doublings + 1):
        share = 8**i / total

        def part(fraction: float, done: float = done, share: float = share) -> None:
            report(done + share * fraction)

        solutions.append(solve_dp(cycle, vehicle, current, part, use_cache))
        current = current.doubled()
        done += share
    return tuple(solutions)


def _ignore(_: float) -> None:
    pass
