"""QP backends behind one interface."""

from qpmpc.solvers.base import QpSolution, QpSolver, Status
from qpmpc.solvers.osqp import Osqp, OsqpSettings
from qpmpc.solvers.registry import make_solver, solver_names

__all__ = [
    "Osqp",
    "OsqpSettings",
    "QpSolution",
    "QpSolver",
    "Status",
    "make_solver",
    "solver_names",
]
