"""`mh-nlp`: the nonlinear reference of `mh-qp`, with the same preview, ladder and safety layer."""

from dataclasses import replace

import numpy as np

from qpmpc.controllers.ramp import RampFloor
from qpmpc.controllers.realise import STAY_SHARE
from qpmpc.controllers.receding_horizon import Plan, Planner
from qpmpc.controllers.settings import SettingsLike
from qpmpc.trip import Observation, Trip
from qpmpc.verification.nonlinear.problem import NlpProblem, NlpVar
from qpmpc.verification.nonlinear.solver import NlpPlan, NlpSolver


class MhNlp(Planner):
    """Multi-horizon MPC as a nonlinear program, solved to convergence by IPOPT at every step.

    Parameters
    ----------
    trip, settings : as of `Planner`; of `mh_qp` its horizon, terminal band and margins apply

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """

    name = "mh-nlp"
    solver_name = "ipopt"

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        super().__init__(trip, settings)
        of_qp = self.settings.mh_qp
        self.preview = trip.preview(of_qp.horizon)
        self._short = of_qp.horizon.short_stages
        problem = NlpProblem(trip.vehicle, self.preview.count, self._short, of_qp.qp)
        self.solver = NlpSolver(problem)
        self._shift = self.preview.shift()
        self._ramp = RampFloor(trip.vehicle)
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
        on_share = solved.z[: self._short, NlpVar.ON]
        powers_w = np.zeros_like(on_share)
        for stage in np.flatnonzero(on_share >= STAY_SHARE).tolist():
            powers_w[stage] = solved.power_on_w(stage)
        arrival_s = solved.stages.arrival_s(self._short)
        least_w = self._ramp.least_w(solved.stages.seconds_w(self._short), seen.soc)
        return Plan(
            on_share,
            powers_w,
            True,
            solved.iterations,
            arrival_s=arrival_s,
            least_w=least_w,
            fast_s=solved.stages.fast_s(self._short, self.trip.vehicle),
            stay_share=STAY_SHARE,
        )

    def forget(self) -> None:
        """Forget preview and last solution, as after a restart of the controller under way."""
        self.preview.forget()
        self._last = None

    def solve(self, seen: Observation) -> NlpPlan:
        """Solve the program of this second, warm from the last plan if there is one.

        If the warm start fails, the step is solved again from cold.
        """
        stages = self.preview.ahead(seen.step, seen.engine_on, seen.engine_for_s)
        start = self._last
        if start is not None:
            for _ in range(seen.step - self._last_step):
                start = start.shifted(self._shift)
        state = seen.soc, seen.t_cl_degc
        plan = self.solver.solve(stages, *state, start, seen.engine_on)
        if not plan.solved and start is not None:
            again = self.solver.solve(stages, *state, None, seen.engine_on)
            plan = replace(again, iterations=again.iterations + plan.iterations)
        if self.solver_fails:
            plan = replace(plan, solved=False)
        if plan.solved:
            self._last, self._last_step = plan, seen.step
        return plan
