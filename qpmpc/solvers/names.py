"""QP backends by name; other packages add theirs by entry points of ``qpmpc.solvers``."""

from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped
from qpmpc.solvers.base import QpSolver
from qpmpc.solvers.timed import DEFAULT_TOLERANCE, require

_THROUGH = "qpsolvers:"

SOLVERS = Names(
    "solver",
    {
        name: Shipped(f"qpmpc.solvers.{name}:{name.capitalize()}")
        for name in ("osqp", "piqp", "clarabel", "daqp", "qoco", "highs", "proxqp", "scs")
    },
    also=f", or {_THROUGH}NAME",
)


def solver_names() -> tuple[str, ...]:
    """Return the names of the native backends, the default first."""
    return tuple(SOLVERS.shipped)


def make_solver(name: str, tolerance: float = DEFAULT_TOLERANCE) -> QpSolver:
    """Make a backend.

    Parameters
    ----------
    name : one of `SOLVERS`, or ``qpsolvers:NAME`` for any solver that qpsolvers finds
    tolerance : of the shipped backends, on the KKT residuals; OSQP runs a fixed number of
        iterations instead (`AdmmSettings`)

    Raises
    ------
    InputError
        If the name is unknown, its package is not installed, or the tolerance is out of range.
    """
    if name.startswith(_THROUGH):
        return _through_qpsolvers(name.removeprefix(_THROUGH), tolerance)
    backend = SOLVERS.find(name)
    made: QpSolver = backend() if name == "osqp" or name in SOLVERS.added else backend(tolerance)
    return made


def _through_qpsolvers(solver: str, tolerance: float) -> QpSolver:
    from qpmpc.solvers.through_qpsolvers import ThroughQpsolvers

    found = require("qpsolvers", solver).available_solvers
    if solver not in found:
        raise InputError(
            f"qpsolvers finds no solver {solver!r} here, only {', '.join(sorted(found))}"
        )
    return ThroughQpsolvers(solver, tolerance)
