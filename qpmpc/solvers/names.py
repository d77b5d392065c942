"""QP backends by name; other packages add theirs by entry points of ``qpmpc.solvers``."""

from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped, hint
from qpmpc.problems import shown_value
from qpmpc.solvers.base import QpSolver
from qpmpc.solvers.timed import DEFAULT_TOLERANCE, require

_THROUGH = "qpsolvers:"

SOLVERS = Names(
    "solver",
    {
        "osqp": Shipped("qpmpc.solvers.osqp:Osqp"),
        "piqp": Shipped("qpmpc.solvers.piqp:Piqp"),
        "piqp-multistage": Shipped("qpmpc.solvers.piqp:PiqpMultistage"),
        "clarabel": Shipped("qpmpc.solvers.clarabel:Clarabel"),
        "hpipm": Shipped("qpmpc.solvers.hpipm:Hpipm"),
        "daqp": Shipped("qpmpc.solvers.daqp:Daqp"),
        "qoco": Shipped("qpmpc.solvers.qoco:Qoco"),
        "qpalm": Shipped("qpmpc.solvers.qpalm:Qpalm"),
        "highs": Shipped("qpmpc.solvers.highs:Highs"),
        "proxqp": Shipped("qpmpc.solvers.proxqp:Proxqp"),
        "scs": Shipped("qpmpc.solvers.scs:Scs"),
        "qpoases": Shipped("qpmpc.solvers.qpoases:Qpoases"),
    },
    also=f", or {_THROUGH}NAME",
)


def solver_names() -> tuple[str, ...]:
    """Return the names of the native backends, the default first."""
    return tuple(SOLVERS.shipped)


def make_solver(
    name: str, tolerance: float = DEFAULT_TOLERANCE, iterations: int | None = None
) -> QpSolver:
    """Make a backend.

    Parameters
    ----------
    name : one of `SOLVERS`, or ``qpsolvers:NAME`` for any solver that qpsolvers finds
    tolerance : of the shipped backends, on the KKT residuals; OSQP runs a fixed number of
        iterations instead (`AdmmSettings`)
    iterations : of the shipped backends other than OSQP, at most; their own limit if None

    Raises
    ------
    InputError
        If the name is unknown, its package is not installed, or a number is out of range.
    """
    if name.startswith(_THROUGH):
        return _through_qpsolvers(name.removeprefix(_THROUGH), tolerance)
    backend = SOLVERS.find(name)
    if name == "osqp" or name in SOLVERS.added:
        made: QpSolver = backend()
    else:
        made = backend(tolerance, iterations)
    return made


def _through_qpsolvers(solver: str, tolerance: float) -> QpSolver:
    from qpmpc.solvers.through_qpsolvers import ThroughQpsolvers

    found = require("qpsolvers", solver).available_solvers
    if solver not in found:
        raise InputError(
            f"qpsolvers finds no solver {shown_value(solver)} here{hint(solver, found)} "
            f"use one of {', '.join(sorted(found))}"
        )
    return ThroughQpsolvers(solver, tolerance)
