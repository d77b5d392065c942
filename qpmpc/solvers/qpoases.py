"""qpOASES: parametric active set, dense, through CasADi's plugin; hot-started."""

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status, nothing
from qpmpc.solvers.casadi_conic import CasadiConic, check_plugin
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.forms import BoundsApart
from qpmpc.solvers.timed import Outcome, TimedSolver, array

CHANGES = 20_000  # of the working set; 62 stages from cold need 1,000


class Qpoases(TimedSolver):
    """Backend over CasADi's plugin `qpoases`, which keeps matrices and working set.

    It is dense: CasADi's wheel has no linear solver that its sparse variant could use. Its time
    grows with the cube of the number of stages. `tolerance` is unused: an active-set method ends
    at a vertex. qpOASES reports an infeasible problem as any failure: a linear program decides.
    Each new instance prints qpOASES's licence, whatever its print level.
    """

    name = "qpoases"
    package = "casadi"
    max_iterations = CHANGES
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        check_plugin(self.module, self.name)
        self._pattern = structure
        self._form = BoundsApart(structure)
        self._forget()
        self._update(data)

    def _forget(self) -> None:
        self._is_new = True
        rows = self._form.rows
        self._solver = CasadiConic(
            self.module,
            self.name,
            rows.shape,
            rows.indices,
            rows.indptr,
            {"printLevel": "none", "nWSR": self.limit, "hessian_type": "semidef"},
        )

    def _fits(self, data: QpData) -> bool:
        return True

    def _update(self, data: QpData) -> None:
        low, high = self._form.row_bounds(data)
        least, most = self._form.bounds(data)
        self._values = {
            "h": data.hessian,
            "g": data.q,
            "a": self._form.rows.values(data),
            "lba": low,
            "uba": high,
            "lbx": least,
            "ubx": most,
        }

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        if primal is None and not self._is_new:
            self._forget()
        stats = self._solver.solve(**self._values)
        self._is_new = False
        found = self._solver.found
        iterations, own_s = int(stats["iter_count"]), stats["own_s"]
        status = Status.SOLVED if stats["success"] else Status.FAILED
        if status is not Status.SOLVED:
            self._forget()
            if iterations >= self.limit:
                status = Status.ITERATION_LIMIT
            elif is_infeasible(self._pattern, data):
                status = Status.INFEASIBLE
            return Outcome(*nothing(data), status, iterations, own_s)
        return Outcome(
            array(found["x"]),
            self._form.join(data, found["lam_a"], found["lam_x"]),
            status,
            iterations,
            own_s,
        )
