"""ProxQP: proximal augmented Lagrangian, dense, persistent and warm-started.

The sparse variant of ProxQP 0.7 and 0.8 never returns on some of these QPs, whatever its iteration
limits and its start; the dense one solves them all.
"""

from typing import Any

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.forms import TwoSided
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "PROXQP_SOLVED": Status.SOLVED,
    "PROXQP_MAX_ITER_REACHED": Status.ITERATION_LIMIT,
    "PROXQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
    "PROXQP_DUAL_INFEASIBLE": Status.INFEASIBLE,
}
INNER_LIMIT = 300
INFEASIBLE = 1e-10  # by its default, 1e-4, it calls some feasible QPs infeasible


class Proxqp(TimedSolver):
    """Backend over the native dense ProxQP interface.

    Its own test seldom detects an infeasible problem before the iteration limit; at the limit, a
    linear program decides.
    """

    name = "proxqp"
    package = "proxsuite"
    max_iterations = 100  # outer ones
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._pattern = structure
        self._form = TwoSided(structure, data)
        self._guess = self.module.proxqp.InitialGuess
        equalities, inequalities = self._form.equalities.rows, self._form.inequalities.rows
        self._solver: Any = self.module.proxqp.dense.QP(
            structure.shape[1], len(equalities), len(inequalities)
        )
        settings = self._solver.settings
        settings.compute_timings = True
        settings.eps_abs, settings.eps_rel = self.tolerance, 0.0
        settings.eps_primal_inf = INFEASIBLE
        settings.max_iter, settings.max_iter_in = self.limit, INNER_LIMIT
        self._solver.init(**self._values(data))

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        self._solver.update(**self._values(data), update_preconditioner=True)

    def _values(self, data: QpData) -> dict[str, Any]:
        b, low, high = self._form.right_sides(data)
        return {
            "H": np.diag(data.hessian),
            "g": data.q,
            "A": self._form.equalities.matrix(data).toarray(),
            "b": b,
            "C": self._form.inequalities.matrix(data).toarray(),
            "l": low,
            "u": high,
        }

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        if primal is None or dual is None:
            self._start(self._pattern, data)  # leftovers of the last solve can mislead it
            self._solver.settings.initial_guess = self._guess.EQUALITY_CONSTRAINED_INITIAL_GUESS
            self._solver.solve()
        else:
            self._solver.settings.initial_guess = self._guess.WARM_START
            self._solver.solve(primal, *self._form.part(dual))
        result = self._solver.results
        status = _STATUS.get(result.info.status.name, Status.FAILED)
        if (
            status is Status.ITERATION_LIMIT
            and not self.capped
            and is_infeasible(self._pattern, data)
        ):
            status = Status.INFEASIBLE
        return Outcome(
            array(result.x),
            self._form.join(array(result.y), array(result.z)),
            status,
            int(result.info.iter),
            1e-6 * float(result.info.solve_time),
        )
