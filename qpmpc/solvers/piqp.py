"""PIQP: proximal interior point, sparse, persistent; it starts each solve from cold."""

from typing import Any

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status
from qpmpc.solvers.forms import TwoSided, hessian_matrix
from qpmpc.solvers.timed import Outcome, TimedSolver, array

_STATUS = {
    "PIQP_SOLVED": Status.SOLVED,
    "PIQP_MAX_ITER_REACHED": Status.ITERATION_LIMIT,
    "PIQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": Status.INFEASIBLE,
}


class Piqp(TimedSolver):
    """Backend over the native PIQP interface."""

    name = "piqp"
    package = "piqp"
    max_iterations = 250
    kkt_solver = "sparse_ldlt"

    def _start(self, structure: QpStructure, data: QpData) -> None:
        self._form = TwoSided(structure, data)
        self._solver: Any = self.module.SparseSolver()
        settings = self._solver.settings
        settings.eps_abs = settings.eps_duality_gap_abs = self.tolerance
        settings.max_iter, settings.compute_timings = self.limit, True
        settings.kkt_solver = getattr(self.module.KKTSolver, self.kkt_solver)
        settings.eps_rel = settings.eps_duality_gap_rel = 0.0
        self._solver.setup(**self._values(data))

    def _fits(self, data: QpData) -> bool:
        return self._form.fits(data)

    def _update(self, data: QpData) -> None:
        self._solver.update(**self._values(data))

    def _values(self, data: QpData) -> dict[str, Any]:
        b, low, high = self._form.right_sides(data)
        return {
            "P": hessian_matrix(data),
            "c": data.q,
            "A": self._form.equalities.matrix(data),
            "b": b,
            "G": self._form.inequalities.matrix(data),
            "h_l": low,
            "h_u": high,
        }

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        status = self._solver.solve()
        result = self._solver.result
        return Outcome(
            array(result.x),
            self._form.join(array(result.y), array(result.z_u) - array(result.z_l)),
            _STATUS.get(status.name, Status.FAILED),
            int(result.info.iter),
            float(result.info.solve_time),
        )


class PiqpMultistage(Piqp):
    """The same with PIQP's backend for multistage problems, which finds the stages by itself."""

    name = "piqp-multistage"
    kkt_solver = "sparse_multistage"
