"""Own solver: any QP code that can be set up once and updated, here OSQP to a tolerance."""

import osqp
import scipy.sparse as sp

import qpmpc
from qpmpc.solvers import QpSolution, Status


class Adaptive:
    name = "osqp adaptive"

    def setup(self, structure, data):
        self._osqp = osqp.OSQP()
        a = structure.matrix_of(data.a_data)
        p = sp.diags(data.hessian, format="csc")
        self._osqp.setup(p, data.q, a, data.lower, data.upper, verbose=False, eps_abs=1e-5)

    def solve(self, data, primal, dual, cold=False):
        self._osqp.update(q=data.q, l=data.lower, u=data.upper, Ax=data.a_data)
        self._osqp.warm_start(x=primal, y=dual)
        found = self._osqp.solve(raise_error=False)
        status = Status.SOLVED if found.info.status == "solved" else Status.ITERATION_LIMIT
        return QpSolution(found.x, found.y, status, found.info.iter, found.info.solve_time)


trip = qpmpc.Trip("nycc")
run = qpmpc.simulate(trip, qpmpc.MhQp(trip, solver=Adaptive()))
print(f"{run.solver}: {run.fuel_soc_balanced_g:.2f} g, {run.summary()['solver']}")
