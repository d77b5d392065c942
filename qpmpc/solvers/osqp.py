"""OSQP, native and persistent, with a fixed number of iterations."""

from time import perf_counter
from typing import Any

import numpy as np
import osqp

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, QpSolution, Status, consistent, failed
from qpmpc.solvers.forms import hessian_matrix
from qpmpc.solvers.settings import AdmmSettings

# For OSQP: no scaling, which would differ from step to step, no adaptation, no early exit.
SAME_WORK: dict[str, Any] = {
    "scaling": 0,
    "adaptive_rho": False,
    "check_termination": 0,
    "check_dualgap": False,
    "polishing": False,
    "verbose": False,
}

_STATUS = {
    "solved": Status.SOLVED,
    "solved inaccurate": Status.ITERATION_LIMIT,
    "maximum iterations reached": Status.ITERATION_LIMIT,
    "primal infeasible": Status.INFEASIBLE,
    "primal infeasible inaccurate": Status.INFEASIBLE,
    "dual infeasible": Status.INFEASIBLE,
    "dual infeasible inaccurate": Status.INFEASIBLE,
}


class Osqp:
    """Backend over the native OSQP interface; one instance serves one trip."""

    name = "osqp"

    def __init__(self, settings: AdmmSettings | None = None) -> None:
        self.settings = settings or AdmmSettings()
        self._solver: Any = None
        self._iterations = 0
        self._hessian: Floats = np.empty(0)

    def setup(self, structure: QpStructure, data: QpData) -> None:
        """Set up OSQP; the numbers are replaced in every solve."""
        self._solver = osqp.OSQP()
        self._iterations = self.settings.iterations
        self._hessian = data.hessian
        self._solver.setup(
            P=hessian_matrix(data),
            q=data.q,
            A=structure.matrix_of(data.a_data),
            l=data.lower,
            u=data.upper,
            **SAME_WORK,
            max_iter=self._iterations,
            rho=self.settings.rho,
            sigma=self.settings.proximal_weight,
            alpha=self.settings.relaxation,
            eps_abs=self.settings.status_tolerance,
            eps_rel=self.settings.status_tolerance,
        )

    def solve(
        self, data: QpData, primal: Floats | None, dual: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Update the values and run exactly K iterations (`cold_iterations` if `cold`)."""
        if not consistent(data):
            return failed(data)
        self._set_iterations(self.settings.cold_iterations if cold else self.settings.iterations)
        changed = {} if np.array_equal(data.hessian, self._hessian) else {"Px": data.hessian}
        self._hessian = data.hessian
        start = perf_counter()
        self._solver.update(q=data.q, l=data.lower, u=data.upper, Ax=data.a_data, **changed)
        updated = perf_counter()
        self._solver.warm_start(
            x=np.zeros_like(data.q) if primal is None else primal,
            y=np.zeros_like(data.lower) if dual is None else dual,
        )
        result = self._solver.solve(raise_error=False)
        done = perf_counter()
        if result.info.status == "interrupted":
            raise KeyboardInterrupt  # OSQP takes Ctrl-C away from Python while it solves
        return QpSolution(
            primal=np.asarray(result.x, dtype=float),
            dual=np.asarray(result.y, dtype=float),
            status=_STATUS.get(result.info.status, Status.FAILED),
            iterations=int(result.info.iter),
            solve_s=done - updated,
            update_s=updated - start,
            own_s=float(result.info.solve_time),
        )

    def _set_iterations(self, count: int) -> None:
        if count != self._iterations:
            self._solver.update_settings(max_iter=count)
            self._iterations = count
