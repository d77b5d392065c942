"""Planner: one QP a step, linearised about and warm-started from the last, shifted along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import StageBuilder, Stages
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import VARS
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.solvers.base import QpSolution, QpSolver

Floats = NDArray[np.float64]

DEPARTURE_LINEARISATIONS = 5
FAILURES_FORGIVEN = 2  # unusable solutions in a row that do not cost the plan before them
WARM_UP_STEPS = 5  # of K iterations; measured: fewer gain nothing, more leave the rules driving


@dataclass(frozen=True)
class Plan:
    """Solution of one QP in SI units.

    Attributes
    ----------
    stages : the horizon
    x : variables, shape (n, VARS), columns as in `Var`
    duals : g of fuel per SI unit of each row, shape (n, rows)
    solution : what the solver said
    """

    stages: Stages
    x: Floats
    duals: Floats
    solution: QpSolution


class Planner:
    """Solves the trip's QP step after step, each in the same fixed time.

    A QP this close to a linear program needs some thousand iterations from cold. `prepare` spends
    them before the trip starts, when time does not matter. Without it, or after a reset on the
    road, every step spends the same K iterations from the last one's result, and `ready` stays
    false for `WARM_UP_STEPS` steps, in which something else has to drive.

    Parameters
    ----------
    preview : cuts the trip into stages
    qp : values of the QP
    solver : backend

    Attributes
    ----------
    plan : last usable solution, None after a reset
    ready : whether the plan may be acted on
    """

    def __init__(self, preview: StageBuilder, qp: StageQp, solver: QpSolver) -> None:
        self.preview, self.qp, self.solver = preview, qp, solver
        self.plan: Plan | None = None
        self.data: QpData | None = None
        self._plan_step = 0
        self._solves = 0
        self._failures = 0
        self._is_set_up = False
        self._shift = preview.shift()

    @property
    def ready(self) -> bool:
        """Whether enough iterations have been spent since the last reset."""
        return self._solves >= WARM_UP_STEPS

    def prepare(self, step: int, soc: float, t_cl_degc: float) -> None:
        """Solve the QP of time step `step` from cold, with several linearisations, to the end."""
        stages = self.preview.at(step)
        about, start = Linearisation.constant(self.preview.count, t_cl_degc), None
        for _ in range(DEPARTURE_LINEARISATIONS):
            plan = self._solve(stages, soc, t_cl_degc, about, start, cold=True)
            if not plan.solution.usable:
                return
            about, start = self._about(plan.x, t_cl_degc), (plan.x, plan.duals)
        self.plan, self._plan_step, self._solves = plan, step, WARM_UP_STEPS

    def solve(self, step: int, soc: float, t_cl_degc: float) -> Plan:
        """Spend one step's iterations on the QP of time step `step`.

        They start from the last usable plan, shifted by as many steps as have passed, or from
        nothing after a reset. An unusable result leaves that plan in place, until so many came in
        a row that the plan may be the reason: then the next step starts from nothing.
        """
        stages = self.preview.at(step)
        if self.plan is None:
            about, start = Linearisation.constant(self.preview.count, t_cl_degc), None
        else:
            x, duals = self.plan.x, self.plan.duals
            for _ in range(step - self._plan_step):
                x, duals = x[self._shift], duals[self._shift]
            about, start = self._about(x, t_cl_degc), (x, duals)
        plan = self._solve(stages, soc, t_cl_degc, about, start)
        if plan.solution.usable:
            self.plan, self._plan_step = plan, step
            self._solves += 1
            self._failures = 0
        elif self._failures < FAILURES_FORGIVEN:
            self._failures += 1
        else:
            self.reset()
        return plan

    def reset(self) -> None:
        """Forget the last solution, as after a restart of the controller on the road."""
        self.plan, self._solves, self._failures = None, 0, 0

    def _about(self, x: Floats, t_cl_degc: float) -> Linearisation:
        return Linearisation.about(x, t_cl_degc, self.preview.settings)

    def _solve(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        start: tuple[Floats, Floats] | None,
        cold: bool = False,
    ) -> Plan:
        data = self.qp.update(stages, soc, t_cl_degc, about)
        if not self._is_set_up:
            self.solver.setup(self.qp.structure, data)
            self._is_set_up = True
        z = y = None
        if start is not None:
            z = data.scaling.solver_primal(start[0].ravel())
            y = data.scaling.solver_dual(start[1].ravel())
        solution = self.solver.solve(data, z, y, cold=cold)
        self.data = data
        return Plan(
            stages,
            data.scaling.primal(solution.z).reshape(-1, VARS),
            data.scaling.dual(solution.y).reshape(len(stages.duration_s), -1),
            solution,
        )
