"""What a step costs: `mh-qp`, our program in cvxpy with one term, and that program in generated C.

Wall times of this machine, one after the other; compare them with each other, not with a board's.
"""

import sys

import cvxpy as cp
import numpy as np

import qpmpc
from qpmpc.codegen.from_cvxpy import in_c

SECONDS = int(sys.argv[1]) if len(sys.argv) > 1 else 40


class Gentle(qpmpc.CvxpyPlanner):
    name = "gentle"

    def terms(self, program):
        return 0.002 * cp.norm1(cp.diff(program.p_eng_w[:20]) / 1e3), []


class Watched(Gentle):
    name = "gentle-watched"
    solver_ms: list[float] = []  # noqa: RUF012 - of its one instance

    def solved(self):
        found = super().solved()
        self.solver_ms.append(1e3 * self.program.problem.solver_stats.solve_time)
        return found


class Anew(Gentle):
    name = "gentle-anew"

    def solved(self):
        self.program.problem = cp.Problem(self.program.objective, self.program.constraints)
        return super().solved()


nycc = qpmpc.load_cycle("nycc")
first = [values[: SECONDS + 1] for values in (nycc.time_s, nycc.speed_mps, nycc.grade)]
cycle = qpmpc.Cycle(f"nycc-{SECONDS}", *first)
trip = qpmpc.Trip(cycle, qpmpc.load_vehicle("prius-nimh"))


def median_ms(controller, **settings):
    """Drive the trip; return the median of the steps."""
    run = qpmpc.simulate(trip, controller, settings=settings or None)
    return run.summary()["step_time_ms"]["median"]


rows = {
    "mh-qp, host C": median_ms("mh-qp", **{"mh_qp.implementation": "c"}),
    "mh-qp, Python and OSQP": median_ms("mh-qp", **{"mh_qp.implementation": "python"}),
    "cvxpy, built anew each second": median_ms(Anew),
    "cvxpy, parametrised": median_ms(Watched),
    "  of that the solver, Clarabel": np.median(Watched.solver_ms),
    "generated C, QOCO": median_ms(in_c(Gentle)),
}
unit = rows["mh-qp, host C"]
print(f"{f'median of {SECONDS} steps':34} {'ms':>8} {'times host C':>13}")
for name, ms in rows.items():
    print(f"{name:34} {ms:8.3f} {ms / unit:13.1f}")
