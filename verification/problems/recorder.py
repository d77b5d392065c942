"""Recording of the QPs that a controller solves in closed loop."""

from dataclasses import dataclass

from qpmpc.closed_loop import drive
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.qp_planner import Solve
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.structure import QpStructure
from qpmpc.results import Run
from qpmpc.solvers.base import QpSolver
from qpmpc.trip import Trip


@dataclass(frozen=True)
class Recording:
    """The QPs of one run, in order: several at departure, then one per step.

    Attributes
    ----------
    controller : as it was at arrival
    solves : values, warm start and solution of each QP, in solver units
    """

    controller: MhQp
    solves: list[Solve]
    run: Run

    @property
    def structure(self) -> QpStructure:
        """Pattern of the QPs."""
        return self.controller.planner.qp.structure

    @property
    def on_the_road(self) -> list[Solve]:
        """The QP of each step, those of the departure left out."""
        return self.solves[-len(self.run.trajectory.fuel_g) :]


def record(
    trip: Trip, settings: ControllerSettings | None = None, solver: QpSolver | None = None
) -> Recording:
    """Drive a trip with `mh-qp` and record its QPs.

    Parameters
    ----------
    trip, settings : as of `MhQp`
    solver : backend that drives; OSQP with the settings' iterations if None
    """
    solves: list[Solve] = []
    controller = MhQp(trip, settings, solver=solver, on_solve=solves.append)
    return Recording(controller, solves, drive(trip, controller))
