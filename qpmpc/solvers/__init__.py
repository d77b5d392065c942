"""QP backends behind one interface: `base` has it, `names` makes them by name."""

from qpmpc.solvers.base import QpSolution, QpSolver, Status
from qpmpc.solvers.names import make_solver, solver_names
from qpmpc.solvers.settings import AdmmSettings

__all__ = [
    "AdmmSettings",
    "QpSolution",
    "QpSolver",
    "Status",
    "make_solver",
    "solver_names",
]
