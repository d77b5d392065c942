"""The multi-horizon QP controller in Python, with our horizons and the paper's."""

from collections.abc import Callable

from qpmpc.controllers.qp_planner import QpPlanner, Solve
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import SettingsLike, as_settings
from qpmpc.remarks import say_once
from qpmpc.solvers.base import QpSolver
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
        settings: SettingsLike | None = None,
        *,
        solver: QpSolver | str | None = None,
        on_solve: Callable[[Solve], None] | None = None,
    ) -> None:
        of_qp = as_settings(settings).mh_qp
        if isinstance(solver, str):
            of_qp, solver = of_qp.model_copy(update={"solver": solver}), None
        planner = QpPlanner(trip, settings, of_qp, solver=solver, on_solve=on_solve)
        super().__init__(trip, planner)
        if of_qp.implementation == "c":
            line = "mh_qp.implementation=c has no effect here: MhQp is in Python"
            self.remarks.append(line)
            say_once(line)


def mh_qp_paper(trip: Trip, settings: SettingsLike | None = None) -> QpPlanner:
    """Make the planner with the paper's grid and averaged preview."""
    settings = as_settings(settings)
    return QpPlanner(trip, settings, settings.mh_qp_paper, name="mh-qp-paper")
