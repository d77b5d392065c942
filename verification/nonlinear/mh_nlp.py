"""`mh-nlp`: the nonlinear reference of `mh-qp`, with the same preview, ladder and safety layer."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.controllers.receding_horizon import ON_THRESHOLD, Plan, Planner
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.qp.stage_qp import QpSettings
from qpmpc.trip import Observation, Trip
from qpmpc.verification.nonlinear.problem import NlpProblem, NlpVar
from qpmpc.verification.nonlinear.solver import NlpPlan, NlpSolver

INTEGRAL = 0.02  # an on-share within this of 0 or 1 counts as integral


class MhNlpSettings(BaseModel):
    """Settings of the nonlinear reference.

    Attributes
    ----------
    horizon, qp : layout of the stages, terminal band and margins; those of `mh-qp`
    on_off : "relaxed" leaves the on-share of a one-second stage between 0 and 1; "homotopy" then
        drives it to 0 or 1 by solving again with a rising price on sigma (1 - sigma)
    on_off_prices_g : the prices, g
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    horizon: HorizonSettings = HorizonSettings()
    qp: QpSettings = QpSettings()
    on_off: Literal["relaxed", "homotopy"] = "relaxed"
    on_off_prices_g: tuple[Annotated[float, Field(gt=0.0)], ...] = (0.1, 1.0, 10.0)


class MhNlp(Planner):
    """Multi-horizon MPC as a nonlinear program, solved to convergence by IPOPT at every step.

    Parameters
    ----------
    trip, settings : as of `Planner`
    of_nlp : horizon, limits, treatment of on/off; those of `mh_qp` if None

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """

    name = "mh-nlp"
    solver_name = "ipopt"

    def __init__(
        self,
        trip: Trip,
        settings: ControllerSettings | None = None,
        of_nlp: MhNlpSettings | None = None,
    ) -> None:
        super().__init__(trip, settings)
        of_qp = self.settings.mh_qp
        self.of_nlp = of_nlp or MhNlpSettings(horizon=of_qp.horizon, qp=of_qp.qp)
        horizon, vehicle = self.of_nlp.horizon, trip.vehicle
        self.preview = trip.preview(horizon)
        count, short = self.preview.count, horizon.short_stages
        self.solver = NlpSolver(NlpProblem(vehicle, count, short, self.of_nlp.qp))
        self._shift = self.preview.shift()
        self._last: NlpPlan | None = None
        self._last_step = 0

    def depart(self, seen: Observation) -> None:
        """Solve the program of departure."""
        self.forget()
        self.solve(seen)

    def plan(self, seen: Observation) -> Plan:
        """Plan with the solution of this second's program."""
        solved = self.solve(seen)
        if not solved.solved:
            return Plan.none("IPOPT does not converge", solved.iterations)
        on_share = solved.z[: self.of_nlp.horizon.short_stages, NlpVar.ON]
        powers_w = np.zeros_like(on_share)
        for stage in np.flatnonzero(on_share >= ON_THRESHOLD).tolist():
            powers_w[stage] = solved.power_on_w(stage)
        return Plan(on_share, powers_w, True, solved.iterations)

    def forget(self) -> None:
        """Forget the last solution, as after a restart of the controller under way."""
        self._last = None

    def solve(self, seen: Observation) -> NlpPlan:
        """Solve the program of this second, warm from the last plan if there is one.

        If the warm start fails, the step is solved again from cold.
        """
        stages = self.preview.at(seen.step)
        start = self._last
        if start is not None:
            for _ in range(seen.step - self._last_step):
                start = start.shifted(self._shift)
        plan = self.solver.solve(stages, seen.soc, seen.t_cl_degc, start)
        if not plan.solved and start is not None:
            again = self.solver.solve(stages, seen.soc, seen.t_cl_degc)
            plan = replace(again, iterations=again.iterations + plan.iterations)
        if plan.solved:
            self._last, self._last_step = plan, seen.step
            if self.of_nlp.on_off == "homotopy":
                return self._integral(plan, seen.soc, seen.t_cl_degc)
        return plan

    def _integral(self, plan: NlpPlan, soc: float, t_cl_degc: float) -> NlpPlan:
        """Drive the on-share of the short stages to 0 or 1, as far as IPOPT gets."""
        short = self.of_nlp.horizon.short_stages
        for price in self.of_nlp.on_off_prices_g:
            sigma = plan.z[:short, NlpVar.ON]
            if np.all(np.minimum(sigma, 1.0 - sigma) < INTEGRAL):
                break
            dearer = self.solver.solve(plan.stages, soc, t_cl_degc, plan, price)
            if not dearer.solved:
                break
            plan = replace(dearer, iterations=dearer.iterations + plan.iterations)
        return plan
