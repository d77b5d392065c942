"""What the checks share: vehicles, cycles, and closed loops with all their QPs, made once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp, MhQpSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.preview.forecast import Trace
from qpmpc.qp.stage_qp import QpData
from qpmpc.results import Run
from qpmpc.simulate import simulate
from qpmpc.solvers.base import Floats, QpSolution, QpSolver
from qpmpc.solvers.osqp import Osqp
from qpmpc.vehicle import Plant, Vehicle, load_vehicle, vehicle_names
from qpmpc.verification.benchmark.recorder import RecordingSolver

QUICK_CYCLES = ("nycc",)
FULL_CYCLES = ("nycc", "nedc-truncated")


class _Keeper(RecordingSolver):
    """Keeps each solution beside its QP."""

    def __init__(self, solver: QpSolver) -> None:
        super().__init__(solver)
        self.solutions: list[QpSolution] = []

    def solve(
        self, data: QpData, z: Floats | None, y: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Solve, and keep the answer."""
        self.solutions.append(super().solve(data, z, y, cold))
        return self.solutions[-1]


@dataclass(frozen=True)
class Loop:
    """One closed loop of `mh-qp`.

    Attributes
    ----------
    settings, controller : of `mh-qp`; the controller as it was at arrival
    run : its trajectory
    data, starts, solutions : of the QP of each time step
    """

    cycle: Cycle
    settings: MhQpSettings
    controller: MhQp
    run: Run
    data: list[QpData]
    starts: list[tuple[Floats, Floats]]
    solutions: list[QpSolution]

    def x(self, step: int) -> Floats:
        """Solution of one step in SI units, shape (stages, variables)."""
        scaling = self.data[step].scaling
        stages = self.controller.planner.preview.count
        return np.asarray(self.solutions[step].z * scaling.column).reshape(stages, -1)

    def sample(self, count: int) -> list[int]:
        """Steps spread evenly over the trip, the first and the last among them."""
        return [int(k) for k in np.linspace(0, self.cycle.steps - 1, count)]


class Context:
    """Runs shared by all checks; nothing is computed before it is asked for.

    Parameters
    ----------
    quick : fewer cycles and samples
    """

    def __init__(self, quick: bool) -> None:
        self.quick = quick
        self.settings = ControllerSettings()
        self._loops: dict[str, Loop] = {}

    @property
    def cycles(self) -> tuple[str, ...]:
        """Names of the cycles on which closed loops are checked."""
        return QUICK_CYCLES if self.quick else FULL_CYCLES

    @cached_property
    def vehicle(self) -> Vehicle:
        """The default vehicle."""
        return load_vehicle()

    @cached_property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """All shipped vehicles."""
        return tuple(load_vehicle(name) for name in vehicle_names())

    def loop(self, cycle: str) -> Loop:
        """Closed loop of `mh-qp` with all its QPs."""
        if cycle not in self._loops:
            self._loops[cycle] = self._drive(load_cycle(cycle))
        return self._loops[cycle]

    @property
    def loops(self) -> list[Loop]:
        """The closed loops of all cycles."""
        return [self.loop(cycle) for cycle in self.cycles]

    def _drive(self, cycle: Cycle) -> Loop:
        mh_qp, rules = self.settings.mh_qp, self.settings.rule_based
        plant, truth = Plant(self.vehicle), Trace.of(cycle, self.vehicle)
        keeper = _Keeper(Osqp(mh_qp.osqp))
        controller = MhQp("mh-qp", plant, truth, truth, mh_qp, rules, solver=keeper)
        run = simulate(cycle, controller, self.vehicle)
        first = len(keeper.qps) - cycle.steps  # before them, those of the preparation
        nothing = np.empty(0)
        starts = [
            (nothing if qp.z is None else qp.z, nothing if qp.y is None else qp.y)
            for qp in keeper.qps[first:]
        ]
        data = [qp.data for qp in keeper.qps[first:]]
        return Loop(cycle, mh_qp, controller, run, data, starts, keeper.solutions[first:])
