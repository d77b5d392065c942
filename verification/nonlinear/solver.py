"""IPOPT on the multi-horizon nonlinear program: built once, warm-started from step to step."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.verification.nonlinear.maps import casadi
from qpmpc.verification.nonlinear.problem import SOC_GAIN_ROW, UNIT, NlpData, NlpProblem, NlpVar

Floats = NDArray[np.float64]

ITERATION_LIMIT = 300
# measured on recorded steps: larger ones cost iterations, smaller ones gain none
WARM_BARRIER, WARM_PUSH = 1e-7, 1e-6
# CasADi's options for derivatives made elsewhere, and its names of them
_DERIVATIVES = {"grad_f": "nlp_grad_f", "jac_g": "nlp_jac_g", "hess_lag": "nlp_hess_l"}
DEPARTURE_SIGMA, DEPARTURE_POWER_W = 0.3, 12e3

_COMMON = {
    "expand": True,
    "print_time": False,
    "calc_lam_p": False,  # sensitivities to the parameters, and the gradient for them alone
    "no_nlp_grad": True,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": ITERATION_LIMIT,
}
_WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": WARM_BARRIER,
    "ipopt.warm_start_bound_push": WARM_PUSH,
    "ipopt.warm_start_bound_frac": WARM_PUSH,
    "ipopt.warm_start_slack_bound_push": WARM_PUSH,
    "ipopt.warm_start_slack_bound_frac": WARM_PUSH,
    "ipopt.warm_start_mult_bound_push": WARM_PUSH,
}


@dataclass(frozen=True)
class NlpPlan:
    """Solution of one nonlinear program.

    Attributes
    ----------
    stages : the horizon
    power_least_w : least power of a running engine, shape (n,)
    z : variables in solver units, shape (n, variables)
    missing, bound_duals, row_duals : further data of a warm start
    cost_g : objective
    solved : whether IPOPT reached its tolerance
    iterations : of IPOPT
    """

    stages: Stages
    power_least_w: Floats
    z: Floats
    missing: float
    bound_duals: Floats
    row_duals: Floats
    cost_g: float
    solved: bool
    iterations: int

    @property
    def x(self) -> Floats:
        """Variables in SI units, shape (n, variables), columns as in `NlpVar`."""
        return np.asarray(self.z * UNIT[: self.z.shape[1]])

    def power_on_w(self, stage: int) -> float:
        """Engine power of a stage while the engine is on."""
        above = self.x[stage, NlpVar.ABOVE] / self.x[stage, NlpVar.ON]
        return float(self.power_least_w[stage] + above)

    @property
    def soc_costate_g(self) -> float:
        """Fuel that more SOC at arrival would save, g per unit: the dual of its last equation."""
        rows = self.row_duals.reshape(len(self.z), -1)
        last = int(np.flatnonzero(self.stages.duration_s > 0.0)[-1])
        return float(-rows[last, SOC_GAIN_ROW] / UNIT[NlpVar.SOC])

    def shifted(self, source: NDArray[np.intp]) -> "NlpPlan":
        """Return the start for the next step: slot i takes the values of slot `source[i]`."""
        bounds = self.bound_duals[:-1].reshape(len(source), -1)[source].ravel()
        rows = self.row_duals.reshape(len(source), -1)[source].ravel()
        return NlpPlan(
            self.stages,
            self.power_least_w,
            self.z[source],
            self.missing,
            np.append(bounds, self.bound_duals[-1]),
            rows,
            self.cost_g,
            self.solved,
            self.iterations,
        )


class NlpSolver:
    """Solves one `NlpProblem` over and over.

    Parameters
    ----------
    problem : the program of the trip
    """

    def __init__(self, problem: NlpProblem) -> None:
        self.problem = problem
        ca = casadi()
        self._cold: Any = ca.nlpsol("cold", "ipopt", problem.program, _COMMON)
        # making the derivatives takes as long as a hundred iterations: both have the same
        made = {option: self._cold.get_function(name) for option, name in _DERIVATIVES.items()}
        self._warm: Any = ca.nlpsol("warm", "ipopt", problem.program, _COMMON | _WARM | made)

    def solve(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        start: NlpPlan | None = None,
        engine_on: bool = False,
    ) -> NlpPlan:
        """Solve for a horizon and a state, from `start`, or from cold.

        Parameters
        ----------
        stages : the trip ahead
        soc, t_cl_degc, engine_on : state at its start
        start : plan to start from
        """
        planned = None if start is None else start.x[:, NlpVar.T_CL]
        data = self.problem.data(stages, soc, t_cl_degc, engine_on, planned)
        if start is None:
            x0 = np.clip(self._departure(soc, t_cl_degc), data.lower, data.upper)
            return self._plan(stages, self._cold, data, x0=x0)
        return self._plan(
            stages,
            self._warm,
            data,
            x0=np.append(start.z.ravel(), start.missing),
            lam_x0=start.bound_duals,
            lam_g0=start.row_duals,
        )

    def _departure(self, soc: float, t_cl_degc: float) -> Floats:
        z = np.zeros((self.problem.stages, self.problem.count))
        z[:, NlpVar.SOC] = soc / UNIT[NlpVar.SOC]
        z[:, NlpVar.T_CL] = t_cl_degc
        z[:, NlpVar.ABOVE] = DEPARTURE_SIGMA * DEPARTURE_POWER_W / UNIT[NlpVar.ABOVE]
        z[:, NlpVar.ON] = DEPARTURE_SIGMA
        return np.append(z.ravel(), 0.0)

    def _plan(self, stages: Stages, solver: Any, data: NlpData, **start: Floats) -> NlpPlan:
        result = solver(
            p=data.parameters,
            lbx=data.lower,
            ubx=data.upper,
            lbg=data.row_lower,
            ubg=data.row_upper,
            **start,
        )
        stats = solver.stats()
        x = _array(result["x"])
        return NlpPlan(
            stages,
            data.power_least_w,
            x[:-1].reshape(self.problem.stages, -1),
            float(x[-1]),
            _array(result["lam_x"]),
            _array(result["lam_g"]),
            float(result["f"]),
            bool(stats["success"]) and bool(np.isfinite(x).all()),
            int(stats["iter_count"]),
        )


def _array(values: Any) -> Floats:
    return np.array(values, dtype=float).ravel()
