"""QPALM: proximal augmented Lagrangian, sparse, persistent, warm-started."""

from typing import Any

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.forms import TINY, hessian_matrix
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "solved": Status.SOLVED,
    "maximum iterations reached": Status.ITERATION_LIMIT,
    "primal infeasible": Status.INFEASIBLE,
    "dual infeasible": Status.INFEASIBLE,
}
NO_BOUND = 1e20  # QPALM's infinity
NEWTON_STEPS = 20_000
CERTIFICATE = 1e-9  # with the default of 1e-5 it calls feasible QPs infeasible


class Qpalm(TimedSolver):
    """Backend over the native QPALM interface.

    Its certificate of infeasibility takes its own tolerance; at the limit of its iterations, a
    linear program decides.
    """

    name = "qpalm"
    package = "qpalm"
    max_iterations = NEWTON_STEPS
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        problem = self.module.Data(structure.shape[1], structure.shape[0])
        problem.Q, problem.A = hessian_matrix(data), structure.matrix_of(data.a_data)
        problem.q = data.q
        problem.bmin, problem.bmax = _bounds(data)
        settings = self.module.Settings()
        settings.eps_abs, settings.eps_rel = self.tolerance, 0.0
        settings.eps_prim_inf = settings.eps_dual_inf = CERTIFICATE
        settings.max_iter, settings.verbose = self.limit, 0
        self._solver: Any = self.module.Solver(problem, settings)

    def _fits(self, data: QpData) -> bool:
        return True

    def _update(self, data: QpData) -> None:
        self._solver.update_Q_A(np.maximum(data.hessian, TINY), data.a_data)
        self._solver.update_q(data.q)
        self._solver.update_bounds(*_bounds(data))

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        self._solver.warm_start(
            np.zeros_like(data.q) if primal is None else primal,
            np.zeros_like(data.lower) if dual is None else dual,
        )
        self._solver.solve()
        info, solution = self._solver.info, self._solver.solution
        status = _STATUS.get(info.status, Status.FAILED)
        if status is Status.ITERATION_LIMIT and not self.capped:
            status = Status.INFEASIBLE if is_infeasible(self._pattern, data) else status
        return Outcome(
            array(solution.x), array(solution.y), status, int(info.iter), float(info.solve_time)
        )


def _bounds(data: QpData) -> tuple[Floats, Floats]:
    return np.maximum(data.lower, -NO_BOUND), np.minimum(data.upper, NO_BOUND)
