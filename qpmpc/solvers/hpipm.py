"""HPIPM: interior point, block-structured (Riccati), through CasADi's plugin; warm-started."""

import numpy as np

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, Status, nothing
from qpmpc.solvers.casadi_conic import CasadiConic, check_plugin
from qpmpc.solvers.feasibility import is_infeasible
from qpmpc.solvers.ocp_form import OcpForm
from qpmpc.solvers.timed import Outcome, TimedSolver, array

SOLVED, ITERATION_LIMIT = 0, 1  # of HPIPM's return status
ITERATIONS = 200
NO_BOUND = 1e4  # in place of infinity, which the plugin does not take; values are of order 100
WARM_MU = 1e-2  # first barrier from a warm start; a decade less or more takes more iterations


class Hpipm(TimedSolver):
    """Backend over CasADi's plugin `hpipm`, mode `speed`, which proved the quickest.

    Other equalities than dynamics are opened by the tolerance to either side: an interior point
    needs an interior. A solution that rests on a bound put in place of infinity belongs to an
    unbounded problem. HPIPM has no status for an infeasible one: if it finds no solution, a linear
    program decides.
    """

    name = "hpipm"
    package = "casadi"
    max_iterations = ITERATIONS
    starts_warm = True

    def _start(self, structure: QpStructure, data: QpData) -> None:
        check_plugin(self.module, self.name)
        self._pattern = structure
        self._form = form = OcpForm(structure)
        # HPIPM measures half of our cost; the plugin knows no controls of the last node: one more
        own = {
            "mode": "speed",
            "iter_max": self.limit,
            "res_g_max": 0.5 * self.tolerance,
            "res_b_max": self.tolerance,
            "res_d_max": self.tolerance,
            "res_m_max": 0.5 * self.tolerance,
        }
        nodes = {"N": structure.stages + 1, "nx": [*form.nx, 0], "nu": [*form.nu, 0]}
        nodes["ng"] = [*form.ng, 0]
        self._cold, self._warm = (
            CasadiConic(
                self.module,
                self.name,
                form.shape,
                form.indices,
                form.indptr,
                {**nodes, "hpipm": own | start},
            )
            for start in ({"warm_start": 0}, {"warm_start": 1, "mu0": WARM_MU})
        )

    def _fits(self, data: QpData) -> bool:
        return True

    def _update(self, data: QpData) -> None:
        form = self._form
        h, g = form.cost(data)
        dynamics, off = form.is_dynamics, self.tolerance
        low, high = form.row_bounds(data)
        low[~dynamics], high[~dynamics] = _apart(low[~dynamics], high[~dynamics], off)
        least, most = _apart(*form.bounds(data), off)
        self._values = {
            "h": h,
            "g": g,
            "a": form.values(data),
            "lba": np.maximum(low, -NO_BOUND),
            "uba": np.minimum(high, NO_BOUND),
            "lbx": np.maximum(least, -NO_BOUND),
            "ubx": np.minimum(most, NO_BOUND),
        }

    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        solver = self._cold if primal is None else self._warm
        start = {} if primal is None else {"x0": self._form.point(primal)}
        stats = solver.solve(**self._values, **start)
        v, rows, bounds = (array(solver.found[key]) for key in ("x", "lam_a", "lam_x"))
        iterations, own_s = int(stats["iter_count"]), stats["own_s"]
        status = Status.SOLVED if stats["return_status"] == SOLVED else Status.FAILED
        if stats["return_status"] == ITERATION_LIMIT:
            status = Status.ITERATION_LIMIT
        if not np.isfinite(v).all():
            status = Status.FAILED
        elif np.abs(v).max() > 0.99 * NO_BOUND:
            return Outcome(*nothing(data), Status.INFEASIBLE, iterations, own_s)
        if status is not Status.SOLVED and not self.capped and is_infeasible(self._pattern, data):
            status = Status.INFEASIBLE
        return Outcome(
            self._form.primal(v), self._form.dual(data, rows, bounds), status, iterations, own_s
        )


def _apart(low: Floats, high: Floats, off: float) -> tuple[Floats, Floats]:
    closed = low == high
    return np.where(closed, low - off, low), np.where(closed, high + off, high)
