"""Clarabel: interior point, sparse, persistent; it starts each solve from cold."""

from typing import Any

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.forms import OneSided, hessian_matrix
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "Solved": Status.SOLVED,
    "AlmostSolved": Status.ITERATION_LIMIT,
    "MaxIterations": Status.ITERATION_LIMIT,
    "PrimalInfeasible": Status.INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INFEASIBLE,
    "DualInfeasible": Status.INFEASIBLE,
    "AlmostDualInfeasible": Status.INFEASIBLE,
}


class Clarabel(TimedSolver):
    """Backend over the native Clarabel interface.

    Its own clock includes the set-up, long ago: there is no `own_s`.
    """

    name = "clarabel"
    package = "clarabel"
    max_iterations = 200

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._form = OneSided(structure, data)
        settings = self.module.DefaultSettings()
        settings.verbose = False
        settings.max_iter = self.limit
        settings.presolve_enable = False  # presolve forbids data updates
        settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = self.tolerance
        equalities, inequalities = self._form.equalities.rows, self._form.inequalities.rows
        self._solver: Any = self.module.DefaultSolver(
            hessian_matrix(data),
            data.q,
            self._form.all.matrix(data),
            np.concatenate(self._form.right_sides(data)),
            [
                self.module.ZeroConeT(len(equalities)),
                self.module.NonnegativeConeT(len(inequalities)),
            ],
            settings,
        )

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        self._solver.update(
            P=np.array(hessian_matrix(data).data),
            q=data.q,
            A=self._form.all.values(data),
            b=np.concatenate(self._form.right_sides(data)),
        )

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        result = self._solver.solve()
        dual = array(result.z)
        equalities = len(self._form.equalities.rows)
        return Outcome(
            array(result.x),
            self._form.join(dual[:equalities], dual[equalities:]),
            _STATUS.get(str(result.status), Status.FAILED),
            int(result.iterations),
        )
