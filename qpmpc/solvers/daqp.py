"""DAQP: dual active set, dense, persistent, warm-started by its last working set."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    1: Status.SOLVED,
    2: Status.SOLVED,  # "soft optimal": there are no soft rows here
    -1: Status.INFEASIBLE,
    -3: Status.INFEASIBLE,  # unbounded
    -4: Status.ITERATION_LIMIT,
}
EQUALITY = 5
PROXIMAL_WEIGHT = 1e-4  # makes the Hessian definite; fewest outer iterations on recorded problems
CYCLES = 100  # steps without progress after which it gives up; its own 10 is too few where rows of
# stages that have no second are degenerate


class Daqp(TimedSolver):
    """Backend over the native DAQP interface.

    The Hessian has zeros, so DAQP runs inside its own proximal-point iterations, which cancel
    the effect of the weight that they add.
    """

    name = "daqp"
    package = "daqp"
    max_iterations = 10_000
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        self._equal = data.lower == data.upper
        self._solver: Any = self.module.Model()
        self._solver.settings = {
            "primal_tol": self.tolerance,
            "dual_tol": self.tolerance,
            "eta_prox": self.tolerance,
            "eps_prox": PROXIMAL_WEIGHT,
            "iter_limit": self.limit,
            "cycle_tol": CYCLES,
        }
        self._solver.setup(*self._values(data), sense=self._sense())

    def _fits(self, data: QpData) -> bool:
        return np.array_equal(data.lower == data.upper, self._equal)

    def _update(self, data: QpData) -> None:
        self._solver.update(*self._values(data))

    def _sense(self) -> NDArray[np.int32]:
        return np.where(self._equal, EQUALITY, 0).astype(np.int32)

    def _values(self, data: QpData) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """H, f, A, upper and lower bounds, dense."""
        a = self._pattern.matrix_of(data.a_data).toarray()
        return np.diag(data.hessian), data.q, a, data.upper, data.lower

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        if primal is None:
            self._start(self._pattern, data)  # cold: without the last working set
        x, _, flag, info = self._solver.solve()
        return Outcome(
            array(x),
            array(info["lam"]),
            _STATUS.get(flag, Status.FAILED),
            int(info["iterations"]),
            float(info["solve_time"]),
        )
