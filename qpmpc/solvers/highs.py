"""HiGHS: active set for QPs, sparse; it starts each solve from cold."""

from typing import Any

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status, nothing
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "kOptimal": Status.SOLVED,
    "kIterationLimit": Status.FAILED,
    "kInfeasible": Status.INFEASIBLE,
    "kUnbounded": Status.INFEASIBLE,
    "kUnboundedOrInfeasible": Status.INFEASIBLE,
}
FINEST_TOLERANCE = 1e-10  # the least that HiGHS takes
ITERATION_LIMIT = 2000  # several times what recorded problems need: beyond it, HiGHS cycles
REGULARISATION = 1e-8  # added to the Hessian's diagonal; without it HiGHS cycles more often


class Highs(TimedSolver):
    """Backend over the native highspy interface; each update passes the whole model.

    HiGHS 1.15 cycles on up to a third of these nearly linear problems, at a point far from the
    optimum; they end as `Status.FAILED`. Enough regularisation to stop the cycling moves the
    optimum just as far.
    """

    name = "highs"
    package = "highspy"
    max_iterations = ITERATION_LIMIT

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        self._solver: Any = self.module.Highs()
        tolerance = max(self.tolerance, FINEST_TOLERANCE)
        options = {
            "output_flag": False,
            "threads": 1,
            "primal_feasibility_tolerance": tolerance,
            "dual_feasibility_tolerance": tolerance,
            "qp_iteration_limit": self.limit,
            "qp_regularization_value": REGULARISATION,
        }
        for key, value in options.items():
            self._solver.setOptionValue(key, value)
        self._update(data)

    def _fits(self, data: QpData) -> bool:
        return True

    def _update(self, data: QpData) -> None:
        rows, variables = self._pattern.shape
        a = self._pattern.matrix_of(data.a_data)
        model = self.module.HighsModel()
        lp, hessian = model.lp_, model.hessian_
        lp.num_col_, lp.num_row_ = variables, rows
        lp.col_cost_ = data.q
        lp.col_lower_ = np.full(variables, -np.inf)
        lp.col_upper_ = np.full(variables, np.inf)
        lp.row_lower_, lp.row_upper_ = data.lower, data.upper
        lp.a_matrix_.format_ = self.module.MatrixFormat.kColwise
        lp.a_matrix_.start_, lp.a_matrix_.index_ = a.indptr, a.indices
        lp.a_matrix_.value_ = a.data
        hessian.dim_ = variables
        hessian.format_ = self.module.HessianFormat.kTriangular
        hessian.start_ = np.arange(variables + 1)
        hessian.index_ = np.arange(variables)
        hessian.value_ = data.hessian
        self._solver.passModel(model)

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        before = self._solver.getRunTime()
        self._solver.run()
        own_s = self._solver.getRunTime() - before
        status = _STATUS.get(self._solver.getModelStatus().name, Status.FAILED)
        iterations = max(int(self._solver.getInfo().qp_iteration_count), 0)
        solution = self._solver.getSolution()
        if not solution.value_valid:
            return Outcome(*nothing(data), status, iterations, own_s)
        return Outcome(
            array(solution.col_value), -array(solution.row_dual), status, iterations, own_s
        )
