"""The multi-horizon QP controller: plan, realise on/off, keep safe, degrade in steps."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.planner import Plan, Planner
from qpmpc.controllers.rule_based import RuleBased, RuleBasedSettings
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import StageBuilder
from qpmpc.pwa.model import PwaModel, PwaTolerances
from qpmpc.qp.rows import Var
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.stage_qp import QpSettings, StageQp
from qpmpc.solvers.base import QpSolver
from qpmpc.solvers.osqp import Osqp, OsqpSettings
from qpmpc.vehicle.plant import Command, Plant

ON_THRESHOLD = 0.5  # share of a 1 s stage from which the engine runs
PLAN_VALID_STEPS = 3  # how many steps an old plan may drive before the rules take over
LEAST_SIZE_W = 1000.0  # power that the relaxation gap is relative to, at least


class MhQpSettings(BaseModel):
    """Everything that shapes the controller; dotted names such as `mh_qp.osqp.iterations`.

    Attributes
    ----------
    solver : `generated` (the whole controller in C, compiled for this machine), `osqp` (the same in
        Python around OSQP) or `auto`: generated where there is a C compiler and the settings allow
    prepared : solve the first QP before the trip starts; if not, the rules drive the first steps
        while the solver warms up
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    horizon: HorizonSettings = HorizonSettings()
    pwa: PwaTolerances = PwaTolerances()
    qp: QpSettings = QpSettings()
    scaling: ScalingSettings = ScalingSettings()
    osqp: OsqpSettings = OsqpSettings()
    solver: Literal["auto", "generated", "osqp"] = "auto"
    prepared: bool = True


class MhQp:
    """Multi-horizon MPC as a QP.

    Parameters
    ----------
    name : under which results are reported
    plant : vehicle and its maps; its step is never called
    truth, forecast : what the short and the long horizon see
    settings : horizon, PWA, weights, scaling, solver
    rules : thresholds of the last rung of the ladder
    solver : backend; OSQP by default
    """

    def __init__(
        self,
        name: str,
        plant: Plant,
        truth: Trace,
        forecast: Trace,
        settings: MhQpSettings,
        rules: RuleBasedSettings,
        solver: QpSolver | None = None,
    ) -> None:
        self.name = name
        vehicle = plant.vehicle
        backend = solver or Osqp(settings.osqp)
        self.solver_name = backend.name
        preview = StageBuilder(vehicle, truth, forecast, settings.horizon)
        model = PwaModel.of(vehicle, settings.pwa)
        qp = StageQp(vehicle, model, preview.count, settings.qp, settings.scaling)
        self.planner = Planner(preview, qp, backend)
        self._model = model
        self._vehicle = vehicle
        self._safety = SafetyLayer(plant, rules.heat_power_w)
        self._rules = RuleBased(plant, rules)
        self._old_plan: Plan | None = None
        self._old_plan_step = 0
        if settings.prepared:
            self.planner.prepare(0, vehicle.trip.soc_init, vehicle.trip.t_cl_init_degc)

    def decide(self, seen: Observation) -> Decision:
        """Run one step: QP, else the shifted last plan, else the rules; safety layer in any case.

        The rules watch every step, so that their timers are right if they have to take over.
        """
        ruled = self._rules.decide(seen)
        plan = self.planner.solve(seen.step, seen.soc, seen.t_cl_degc)
        iterations = plan.solution.iterations
        if plan.solution.usable and self.planner.ready:
            self._old_plan, self._old_plan_step = plan, seen.step
            command = self._safety.admissible(self._realise(plan, 0), seen)
            gap, sigma = self._relaxation_gap(plan), float(plan.x[0, Var.ON])
            return Decision(command, "", iterations, gap, sigma)
        age = seen.step - self._old_plan_step
        short = self.planner.preview.settings.short_stages
        if self._old_plan is not None and age < min(PLAN_VALID_STEPS + 1, short):
            command = self._safety.admissible(self._realise(self._old_plan, age), seen)
            return Decision(command, "shifted plan", iterations)
        return Decision(ruled.command, "rule-based", iterations)

    def reset(self) -> None:
        """Forget plan and warm start, as after a restart of the ECU on the road."""
        self.planner.reset()
        self._old_plan = None

    @staticmethod
    def _realise(plan: Plan, stage: int) -> Command:
        """On/off from the on-share: on from one half up, at the power E / sigma it stands for."""
        sigma = float(plan.x[stage, Var.ON])
        if sigma < ON_THRESHOLD:
            return Command(False, 0.0)
        return Command(True, float(plan.x[stage, Var.P_ENG]) / min(sigma, 1.0))

    def _relaxation_gap(self, plan: Plan) -> float:
        """Slack of the relaxed inequalities at the applied stage, relative.

        (|F - F_pwa| LHV + |G - G_pwa|) / max(|F| LHV + |G|, 1 kW), where F_pwa and G_pwa are the
        relaxed curves at (E, sigma): zero when both inequalities are tight.
        """
        x, net_w = plan.x[0], float(plan.stages.net_w[0])
        p_eng, on = float(x[Var.P_ENG]), float(x[Var.ON])
        fuel, battery = self._model.fuel, self._model.battery
        least_fuel = float((fuel.slope * p_eng + fuel.intercept * on).max())
        off_w = float(plan.stages.internal_off_w[0])
        on_part = battery.slope * (on * net_w - p_eng) + battery.intercept * on
        least_internal = float(on_part.max()) + (1.0 - on) * off_w
        lhv_j_per_g = self._vehicle.engine.lhv_j_per_g
        slack = abs(float(x[Var.FUEL]) - least_fuel) * lhv_j_per_g
        slack += abs(float(x[Var.INTERNAL]) - least_internal)
        size = abs(float(x[Var.FUEL])) * lhv_j_per_g + abs(float(x[Var.INTERNAL]))
        return slack / max(size, LEAST_SIZE_W)
