"""Any other solver, through the qpsolvers package: set up anew at each step."""

import warnings
from typing import Any

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status, nothing
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.forms import OneSided, hessian_matrix
from qpmpc.solvers.timed import DEFAULT_TOLERANCE, Outcome, TimedSolver, array


class ThroughQpsolvers(TimedSolver):
    """Backend over `qpsolvers.solve_problem`, which has neither persistence nor iterations.

    Parameters
    ----------
    solver : a name in `qpsolvers.available_solvers`
    tolerance : unused: each solver keeps its own default, for which there is no common name
    """

    package = "qpsolvers"
    max_iterations = 0  # each solver has its own

    def __init__(self, solver: str, tolerance: float = DEFAULT_TOLERANCE) -> None:
        self.name = f"qpsolvers:{solver}"
        super().__init__(tolerance)
        self._solver = solver

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        self._form = OneSided(structure, data)
        self._update(data)

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        b, h = self._form.right_sides(data)
        matrices = [
            hessian_matrix(data),
            self._form.inequalities.matrix(data),
            self._form.equalities.matrix(data),
        ]
        if self._solver not in self.module.sparse_solvers:
            matrices = [matrix.toarray() for matrix in matrices]
        p, g, a = matrices
        self._problem: Any = self.module.Problem(p, data.q, g, h, a, b)

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        with warnings.catch_warnings(action="ignore"):  # the status reports it
            result = self.module.solve_problem(self._problem, self._solver, initvals=primal)
        if result.found:
            dual = self._form.join(array(result.y), array(result.z))
            return Outcome(array(result.x), dual, Status.SOLVED, 0)
        reason = Status.INFEASIBLE if is_infeasible(self._pattern, data) else Status.FAILED
        return Outcome(*nothing(data), reason, 0)
