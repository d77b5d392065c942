"""Planner: one QP a step, linearised about and warm-started from the last, shifted along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import StageBuilder, Stages
from qpmpc.qp.stage_qp import Linearisation, QpData, StageQp
from qpmpc.qp.structure import VARS, Var
from qpmpc.solvers.base import QpSolution, QpSolver

Floats = NDArray[np.float64]

COLDEST_DEGC, HOTTEST_DEGC = 0.0, 100.0  # where a linearisation point may lie
DEPARTURE_LINEARISATIONS = 5
DEPARTURE_FUEL_G_PER_S = 0.3


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
    """Solves the trip's QP step after step.

    Parameters
    ----------
    preview : cuts the trip into stages
    qp : values of the QP
    solver : backend
    """

    def __init__(self, preview: StageBuilder, qp: StageQp, solver: QpSolver) -> None:
        self.preview, self.qp, self.solver = preview, qp, solver
        self.plan: Plan | None = None
        self.data: QpData | None = None
        self._is_set_up = False
        self._shift = preview.shift()

    def solve(self, step: int, soc: float, t_cl_degc: float) -> Plan:
        """Solve the QP of time step `step`; consecutive steps are warm-started.

        The first solve, and one after `forget`, is cold: several linearisations in turn.
        """
        stages = self.preview.at(step)
        if self.plan is None:
            return self._depart(stages, soc, t_cl_degc)
        x, duals = self.plan.x[self._shift], self.plan.duals[self._shift]
        about = self._linearisation(x, t_cl_degc)
        self.plan = self._solve(stages, soc, t_cl_degc, about, (x, duals))
        return self.plan

    def forget(self) -> None:
        """Drop the last solution: the next solve is cold."""
        self.plan = None

    def _depart(self, stages: Stages, soc: float, t_cl_degc: float) -> Plan:
        n = len(stages.duration_s)
        about = Linearisation(np.full(n, t_cl_degc), np.full(n, DEPARTURE_FUEL_G_PER_S))
        start: tuple[Floats, Floats] | None = None
        for _ in range(DEPARTURE_LINEARISATIONS):
            plan = self._solve(stages, soc, t_cl_degc, about, start, cold=True)
            if not plan.solution.usable:
                return plan
            about, start = self._linearisation(plan.x, t_cl_degc), (plan.x, plan.duals)
        self.plan = plan
        return plan

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

    @staticmethod
    def _linearisation(x: Floats, t_cl_degc: float) -> Linearisation:
        """Mean coolant temperature and fuel rate of each stage of a solution."""
        end = x[:, Var.T_CL]
        mean = 0.5 * end
        mean[0] += 0.5 * t_cl_degc
        mean[1:] += 0.5 * end[:-1]
        return Linearisation(
            np.clip(mean, COLDEST_DEGC, HOTTEST_DEGC), np.maximum(x[:, Var.FUEL], 0.0)
        )
