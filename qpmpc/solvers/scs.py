"""SCS: splitting conic solver, sparse, warm-started; new values of A need a new workspace."""

from typing import Any

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.forms import OneSided, hessian_matrix
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "solved": Status.SOLVED,
    "solved (inaccurate - reached max_iters)": Status.ITERATION_LIMIT,
    "infeasible": Status.INFEASIBLE,
    "infeasible (inaccurate - reached max_iters)": Status.INFEASIBLE,
    "unbounded": Status.INFEASIBLE,
    "unbounded (inaccurate - reached max_iters)": Status.INFEASIBLE,
}


class Scs(TimedSolver):
    """Backend over the native SCS interface."""

    name = "scs"
    package = "scs"
    max_iterations = 100_000
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._form = OneSided(structure, data)
        self._update(data)

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        self._b = np.concatenate(self._form.right_sides(data))
        self._a = self._form.all.matrix(data)
        equalities, inequalities = self._form.equalities.rows, self._form.inequalities.rows
        self._solver: Any = self.module.SCS(
            {"P": hessian_matrix(data), "A": self._a, "b": self._b, "c": data.q},
            {"z": len(equalities), "l": len(inequalities)},
            max_iters=self.limit,
            eps_abs=self.tolerance,
            eps_rel=0.0,
            verbose=False,
        )

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        if primal is None or dual is None:
            result = self._solver.solve(warm_start=False)
        else:
            parts = np.concatenate(self._form.part(dual))
            slack = self._b - self._a @ primal
            result = self._solver.solve(warm_start=True, x=primal, y=parts, s=slack)
        found = array(result["y"])
        equalities = len(self._form.equalities.rows)
        return Outcome(
            array(result["x"]),
            self._form.join(found[:equalities], found[equalities:]),
            _STATUS.get(result["info"]["status"], Status.FAILED),
            int(result["info"]["iter"]),
            1e-3 * float(result["info"]["solve_time"]),
        )
