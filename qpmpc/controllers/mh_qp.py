"""The multi-horizon QP controller in Python, with our horizons and the paper's."""

from collections.abc import Callable

from qpmpc.controllers.qp_planner import QpPlanner, Solve
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.solvers.base import QpSolver
from qpmpc.solvers.names import make_solver
from qpmpc.trip import Trip


class MhQp(RecedingHorizon):
    """Multi-horizon MPC as a QP, solved by any backend.

    Parameters
    ----------
    trip, settings : as of `Controller`
    solver : backend, or its name; that of the settings if None
    on_solve : called with every QP solved
    """

    planner: QpPlanner

    def __init__(
        self,
        trip: Trip,
        settings: ControllerSettings | None = None,
        *,
        solver: QpSolver | str | None = None,
        on_solve: Callable[[Solve], None] | None = None,
    ) -> None:
        backend = make_solver(solver) if isinstance(solver, str) else solver
        super().__init__(trip, QpPlanner(trip, settings, solver=backend, on_solve=on_solve))


def mh_qp_paper(trip: Trip, settings: ControllerSettings | None = None) -> QpPlanner:
    """Make the planner with the paper's grid and averaged preview."""
    settings = settings or ControllerSettings()
    return QpPlanner(trip, settings, settings.mh_qp_paper, name="mh-qp-paper")
