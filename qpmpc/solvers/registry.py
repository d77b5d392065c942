"""Backends by name."""

from collections.abc import Callable
from importlib import import_module

from qpmpc.errors import InputError
from qpmpc.solvers.base import QpSolver
from qpmpc.solvers.osqp import Osqp
from qpmpc.solvers.timed import DEFAULT_TOLERANCE, require

# module: class; imported when asked for, as each needs a package of its own
_NATIVE = {
    "piqp": "Piqp",
    "clarabel": "Clarabel",
    "daqp": "Daqp",
    "qoco": "Qoco",
    "highs": "Highs",
    "proxqp": "Proxqp",
    "scs": "Scs",
}
_THROUGH = "qpsolvers:"


def solver_names() -> tuple[str, ...]:
    """Return the names of the native backends, the default first."""
    return ("osqp", *_NATIVE)


def make_solver(name: str, tolerance: float = DEFAULT_TOLERANCE) -> QpSolver:
    """Make a backend.

    Parameters
    ----------
    name : one of `solver_names`, or ``qpsolvers:NAME`` for any solver that qpsolvers finds
    tolerance : on the KKT residuals; OSQP runs a fixed number of iterations instead
        (`OsqpSettings`)

    Raises
    ------
    InputError
        If the name is unknown, its package is not installed, or the tolerance is out of range.
    """
    if name == "osqp":
        return Osqp()
    if name in _NATIVE:
        backend: Callable[[float], QpSolver] = getattr(
            import_module(f"qpmpc.solvers.{name}"), _NATIVE[name]
        )
        return backend(tolerance)
    if name.startswith(_THROUGH):
        return _through_qpsolvers(name.removeprefix(_THROUGH), tolerance)
    raise InputError(
        f"unknown solver {name!r}: use one of {', '.join(solver_names())}, or {_THROUGH}NAME"
    )


def _through_qpsolvers(solver: str, tolerance: float) -> QpSolver:
    from qpmpc.solvers.through_qpsolvers import ThroughQpsolvers

    found = require("qpsolvers", solver).available_solvers
    if solver not in found:
        raise InputError(
            f"qpsolvers finds no solver {solver!r} here, only {', '.join(sorted(found))}"
        )
    return ThroughQpsolvers(solver, tolerance)
