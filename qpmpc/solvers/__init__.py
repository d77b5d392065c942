"""QP backends behind one interface."""

from qpmpc.solvers.base import QpSolution, QpSolver, Status
from qpmpc.solvers.osqp import Osqp, OsqpSettings

__all__ = ["Osqp", "OsqpSettings", "QpSolution", "QpSolver", "Status"]
