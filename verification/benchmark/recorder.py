"""Recording of the QPs that a controller solves in closed loop."""

from dataclasses import dataclass

from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.results import Run
from qpmpc.simulate import simulate
from qpmpc.solvers.base import Floats, QpSolution, QpSolver
from qpmpc.solvers.osqp import Osqp
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant


@dataclass(frozen=True)
class RecordedQp:
    """One QP of a closed loop, with the start that the controller had for it.

    Attributes
    ----------
    data : values, in solver units
    z, y : warm start, None at departure
    """

    data: QpData
    z: Floats | None
    y: Floats | None


class RecordingSolver:
    """Keeps every QP on its way to another backend.

    Parameters
    ----------
    solver : the backend that solves
    """

    def __init__(self, solver: QpSolver) -> None:
        self.name = solver.name
        self.qps: list[RecordedQp] = []
        self.structure: QpStructure | None = None
        self._solver = solver

    def setup(self, structure: QpStructure, data: QpData) -> None:
        """Pass on, and keep the pattern."""
        self.structure = structure
        self._solver.setup(structure, data)

    def solve(
        self, data: QpData, z: Floats | None, y: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Keep the QP, then solve it."""
        self.qps.append(RecordedQp(data, z, y))
        return self._solver.solve(data, z, y, cold)


@dataclass(frozen=True)
class Recording:
    """The QPs of one run, in order: several at departure, then one a step."""

    structure: QpStructure
    qps: list[RecordedQp]
    run: Run


def record(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: ControllerSettings | None = None,
    solver: QpSolver | None = None,
) -> Recording:
    """Drive a cycle with `mh-qp` and record its QPs.

    Parameters
    ----------
    cycle, vehicle : as in `simulate`
    settings : of the controllers
    solver : backend that drives; OSQP with the settings' iterations if None
    """
    chosen = settings or ControllerSettings()
    plant, truth = Plant(vehicle), Trace.of(cycle, vehicle)
    recorder = RecordingSolver(solver or Osqp(chosen.mh_qp.osqp))
    controller = MhQp(
        "mh-qp", plant, truth, truth, chosen.mh_qp, chosen.rule_based, solver=recorder
    )
    run = simulate(cycle, controller, vehicle)
    if recorder.structure is None:
        raise RuntimeError("the controller solved no QP")
    return Recording(recorder.structure, recorder.qps, run)
