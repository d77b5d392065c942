"""`mh-nlp`: the nonlinear reference of `mh-qp`, with the same preview, ladder and safety layer."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import ON_THRESHOLD, PLAN_VALID_STEPS
from qpmpc.controllers.rule_based import RuleBased, RuleBasedSettings
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import StageBuilder
from qpmpc.qp.stage_qp import QpSettings
from qpmpc.vehicle.plant import Command, Plant
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


class MhNlp:
    """Multi-horizon MPC as a nonlinear program, solved to the end by IPOPT at every step.

    Parameters
    ----------
    plant : vehicle and its maps; its step is never called
    truth, forecast : what the short and the long horizon see
    settings : horizon, limits, treatment of on/off
    rules : thresholds of the last rung of the ladder

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """

    name = "mh-nlp"
    solver_name = "ipopt"

    def __init__(
        self,
        plant: Plant,
        truth: Trace,
        forecast: Trace,
        settings: MhNlpSettings,
        rules: RuleBasedSettings,
    ) -> None:
        self.settings = settings
        vehicle = plant.vehicle
        self.preview = StageBuilder(vehicle, truth, forecast, settings.horizon)
        short = settings.horizon.short_stages
        self.solver = NlpSolver(NlpProblem(vehicle, self.preview.count, short, settings.qp))
        self._shift = self.preview.shift()
        self._safety = SafetyLayer(plant, rules.heat_power_w)
        self._rules = RuleBased(plant, rules)
        self._plan: NlpPlan | None = None
        self._plan_step = 0
        trip = vehicle.trip
        self.plan(0, trip.soc_init, trip.t_cl_init_degc)

    def decide(self, seen: Observation) -> Decision:
        """Run one step: NLP, else the shifted last plan, else the rules; safety layer always."""
        ruled = self._rules.decide(seen)
        plan = self.plan(seen.step, seen.soc, seen.t_cl_degc)
        if plan.solved:
            command = self._safety.admissible(_realise(plan, 0), seen)
            return Decision(command, "", plan.iterations, sigma=float(plan.z[0, NlpVar.ON]))
        age = seen.step - self._plan_step
        short = self.settings.horizon.short_stages
        if self._plan is not None and age < min(PLAN_VALID_STEPS + 1, short):
            command = self._safety.admissible(_realise(self._plan, age), seen)
            return Decision(command, "shifted plan", plan.iterations)
        return Decision(ruled.command, "rule-based", plan.iterations)

    def plan(self, step: int, soc: float, t_cl_degc: float) -> NlpPlan:
        """Solve the program of time step `step`, warm from the last plan if there is one.

        Where the warm start fails, the step is solved again from nothing.
        """
        stages = self.preview.at(step)
        start = self._plan
        if start is not None:
            for _ in range(step - self._plan_step):
                start = start.shifted(self._shift)
        plan = self.solver.solve(stages, soc, t_cl_degc, start)
        if not plan.solved and start is not None:
            again = self.solver.solve(stages, soc, t_cl_degc)
            plan = replace(again, iterations=again.iterations + plan.iterations)
        if plan.solved:
            self._plan, self._plan_step = plan, step
            if self.settings.on_off == "homotopy":
                return self._integral(plan, soc, t_cl_degc)
        return plan

    def _integral(self, plan: NlpPlan, soc: float, t_cl_degc: float) -> NlpPlan:
        """Drive the on-share of the short stages to 0 or 1, as far as IPOPT gets."""
        short = self.settings.horizon.short_stages
        for price in self.settings.on_off_prices_g:
            sigma = plan.z[:short, NlpVar.ON]
            if np.all(np.minimum(sigma, 1.0 - sigma) < INTEGRAL):
                break
            dearer = self.solver.solve(plan.stages, soc, t_cl_degc, plan, price)
            if not dearer.solved:
                break
            plan = replace(dearer, iterations=dearer.iterations + plan.iterations)
        return plan


def _realise(plan: NlpPlan, stage: int) -> Command:
    """On/off from the on-share as in `mh-qp`, at the power planned for the engine when on."""
    if plan.z[stage, NlpVar.ON] < ON_THRESHOLD:
        return Command(False, 0.0)
    return Command(True, plan.power_on_w(stage))


def make_mh_nlp(
    plant: Plant,
    truth: Trace,
    forecast: Trace | None = None,
    settings: ControllerSettings | None = None,
) -> MhNlp:
    """Make the nonlinear reference with the horizon, limits and rules of `mh-qp`.

    Parameters
    ----------
    plant : vehicle and its maps
    truth : what the short horizon sees
    forecast : what the long horizon sees; the truth if None
    settings : of all controllers; those of `mh_qp` and `rule_based` count

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """
    chosen = settings or ControllerSettings()
    nlp = MhNlpSettings(horizon=chosen.mh_qp.horizon, qp=chosen.mh_qp.qp)
    return MhNlp(plant, truth, forecast or truth, nlp, chosen.rule_based)
