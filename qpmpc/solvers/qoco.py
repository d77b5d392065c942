"""QOCO: interior point, sparse, persistent; it starts each solve from cold."""

from typing import Any

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.forms import OneSided, hessian_matrix
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "QOCO_SOLVED": Status.SOLVED,
    "QOCO_SOLVED_INACCURATE": Status.ITERATION_LIMIT,
    "QOCO_MAX_ITER": Status.ITERATION_LIMIT,
}


class Qoco(TimedSolver):
    """Backend over the native QOCO interface.

    QOCO has no status for an infeasible problem: it stops with a numerical error or at its
    iteration limit. If it finds no solution, a linear program decides whether there is one.
    """

    name = "qoco"
    package = "qoco"
    max_iterations = 200

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        self._form = OneSided(structure, data)
        equalities, inequalities = self._form.equalities, self._form.inequalities
        b, h = self._form.right_sides(data)
        self._solver: Any = self.module.QOCO()
        self._solver.setup(
            n=structure.shape[1],
            m=len(inequalities.rows),
            p=len(equalities.rows),
            P=hessian_matrix(data),
            c=data.q,
            A=equalities.matrix(data),
            b=b,
            G=inequalities.matrix(data),
            h=h,
            l=len(inequalities.rows),
            nsoc=0,
            q=None,
            max_iters=self.limit,
            abstol=self.tolerance,
            reltol=self.tolerance,
        )

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        b, h = self._form.right_sides(data)
        self._solver.update_vector_data(data.q, b, h)
        self._solver.update_matrix_data(
            hessian_matrix(data).data,
            self._form.equalities.values(data),
            self._form.inequalities.values(data),
        )

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        result = self._solver.solve()
        status = _STATUS.get(result.status, Status.FAILED)
        if status is not Status.SOLVED and not self.capped and is_infeasible(self._pattern, data):
            status = Status.INFEASIBLE
        return Outcome(
            array(result.x),
            self._form.join(array(result.y), array(result.z)),
            status,
            int(result.iters),
            float(result.solve_time_sec),
        )
