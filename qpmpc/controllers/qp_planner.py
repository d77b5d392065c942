"""Planner of `mh-qp`: one QP per second, expanded about and started from the last plan, shifted."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.coming_second import Coming, least_w, most_w
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.qp_certificate import certificate_of
from qpmpc.controllers.ramp import RampFloor
from qpmpc.controllers.realise import STAY_SHARE, power_while_on_w
from qpmpc.controllers.receding_horizon import Plan, Planner
from qpmpc.controllers.settings import ControllerSettings, MhQpSettings, SettingsLike
from qpmpc.errors import InputError
from qpmpc.preview.stages import Stages
from qpmpc.pwa.learned_fuel import LearnedFuel
from qpmpc.pwa.model import PwaModel, learned_fuel
from qpmpc.qp.expectation import expectation
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.polish import Polish
from qpmpc.qp.relaxation import relaxation_gap
from qpmpc.qp.rows import Var
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.solvers.base import QpSolution, QpSolver, Status, consistent, failed
from qpmpc.solvers.names import make_solver
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Observation, Trip

Floats = NDArray[np.float64]

DEPARTURE_LINEARISATIONS = 5
FAILURES_FORGIVEN = 10  # unusable solutions in a row after which the last usable plan is kept
WARM_UP_STEPS = 5  # of K iterations; measured: fewer gain nothing, with more the rules drive longer


@dataclass(frozen=True)
class QpPlan:
    """Solution of one QP in SI units.

    Attributes
    ----------
    stages : the horizon
    about : what it is expanded about
    x : variables, shape (n, variables), columns as in `Var`
    duals : g of fuel per SI unit of each row, shape (n, rows)
    solution : the solver's result
    """

    stages: Stages
    about: Linearisation
    x: Floats
    duals: Floats
    solution: QpSolution


@dataclass(frozen=True)
class Solve:
    """One QP as given to the solver, and its result, in solver units.

    Attributes
    ----------
    data : values
    primal, dual : start, None where it is cold
    cold : whether it was solved to convergence, before departure
    solution : the solver's result
    """

    data: QpData
    primal: Floats | None
    dual: Floats | None
    cold: bool
    solution: QpSolution


class QpPlanner(Planner):
    """Solves the trip's QP step after step, each in the same fixed time.

    A QP this close to a linear program needs some thousand iterations from cold. `depart` spends
    them before the trip starts, when time does not matter. Without it, or after a reset under
    way, every step spends the same K iterations from the last one's result, and the plan stays
    unusable for `WARM_UP_STEPS` steps, in which the rules have to drive.

    Parameters
    ----------
    trip, settings : as of `Planner`
    of_qp : horizon, PWA curves, weights, scaling, solver; those of `mh_qp` if None
    name : used in reports
    solver : backend; that of the settings if None
    on_solve : called with every QP solved

    Attributes
    ----------
    last : last usable solution, None after a reset
    ready : whether the plan may be acted on
    learned_fuel : what is learned of the fuel curve, None without `learning`

    Raises
    ------
    InputError
        If the settings name an unknown solver, or one that they do not fit.
    """

    def __init__(
        self,
        trip: Trip,
        settings: SettingsLike | None = None,
        of_qp: MhQpSettings | None = None,
        *,
        name: str = "mh-qp",
        solver: QpSolver | None = None,
        on_solve: Callable[[Solve], None] | None = None,
    ) -> None:
        super().__init__(trip, settings)
        self.of_qp = of_qp or self.settings.mh_qp
        self.name = name
        self.solver = solver or _backend(self.of_qp, name)
        self.solver_name = self.solver.name
        self.on_solve = on_solve
        vehicle = trip.vehicle
        self.preview = trip.preview(self.of_qp.horizon)
        learning = self.of_qp.learning
        self.model = PwaModel.of(vehicle, self.of_qp.pwa, learning)
        self.learned_fuel = learned_fuel(vehicle, self.of_qp.pwa) if learning else None
        self.qp = StageQp(
            vehicle, self.model, self.preview.count, self.of_qp.qp, self.of_qp.scaling, learning
        )
        self._polish = Polish(vehicle, self.model, learning)
        self._certificate = certificate_of(self.qp, self.of_qp, name)
        self._ramp = RampFloor(vehicle)
        self.last: QpPlan | None = None
        self._last_step = 0
        self._solves = 0
        self._failures = 0
        self._is_set_up = False
        self._shift = self.preview.shift()

    @property
    def ready(self) -> bool:
        """Whether enough iterations have been spent since the last reset."""
        return self._solves >= WARM_UP_STEPS

    def depart(self, seen: Observation) -> None:
        """Solve the QP of departure from cold, with several linearisations, to convergence."""
        self.forget()
        self.expects = None
        if not self.of_qp.prepared:
            return
        stages, t_cl_degc = self.preview.at(seen.step), seen.t_cl_degc
        about, start = Linearisation.constant(self.preview.count, t_cl_degc), None
        for _ in range(DEPARTURE_LINEARISATIONS):
            plan = self._solve(stages, seen, about, start, cold=True)
            if not plan.solution.usable:
                return
            about, start = self._about(plan.x, t_cl_degc), (plan.x, plan.duals)
        self.last, self._last_step, self._solves = plan, seen.step, WARM_UP_STEPS
        self.expects = expectation(self.trip, self.of_qp.horizon, self.model, stages, plan.x)

    def plan(self, seen: Observation) -> Plan:
        """Spend one step's iterations on the QP of this second."""
        if self.learned_fuel is not None:
            self.learned_fuel.take(
                seen.fuel_g,
                seen.p_eng_before_w,
                seen.t_cl_degc,
                seen.engine_on,
                seen.engine_on and seen.engine_for_s == 1,
            )
            self._use(self.learned_fuel)
        solved = self.solve(seen)
        iterations = solved.solution.iterations
        if not solved.solution.usable:
            return Plan.none(iterations=iterations)
        if not self.ready:
            return Plan.none(iterations=iterations, flags=Flag.WARMING_UP)
        short = slice(self.of_qp.horizon.short_stages)
        on_share = solved.x[short, Var.ON]
        power_w = power_while_on_w(on_share, solved.x[short, Var.P_ENG])
        ramp_w = asked_w = self._ramp.least_w(solved.stages.seconds_w(short.stop), seen.soc)
        if self.of_qp.polish:
            vehicle, polish = self.trip.vehicle, self._polish
            prices, coming = self.qp.prices(solved.duals), self._coming(solved)
            room_w = most_w(vehicle, polish.maps, coming, seen)
            if on_share[0] >= STAY_SHARE:
                net_w = float(solved.stages.net_w[0])
                power_w[0] = min(polish.power_w(prices, net_w, float(power_w[0])), room_w)
            plan = (polish.maps, polish.pieces, coming)
            asked_w = least_w(vehicle, *plan, seen, ramp_w, room_w)
        return Plan(
            on_share,
            power_w,
            True,
            iterations,
            relaxation_gap(self.trip.vehicle, self.model, solved.stages, solved.x),
            arrival_s=solved.stages.arrival_s(self.of_qp.horizon.short_stages),
            least_w=asked_w,
            certificate_g=self._certificate(
                solved.stages, seen, solved.about, solved.x, solved.duals
            ),
            fast_s=solved.stages.fast_s(short.stop, self.trip.vehicle),
            stay_share=STAY_SHARE,
        )

    def _coming(self, solved: QpPlan) -> Coming:
        """Return what the rules of the coming second know of a solution."""
        prices, stages, x = self.qp.prices(solved.duals), solved.stages, solved.x
        short = slice(self.of_qp.horizon.short_stages)
        going = self._polish.going(prices, stages.net_w[short], stages.internal_off_w[short])
        on_share, internal_w = x[:, Var.ON], x[:, Var.INTERNAL]
        of_plan = (stages, on_share, internal_w, on_share[short], going)
        return Coming(*of_plan, prices.fuel, prices.internal)

    def solve(self, seen: Observation) -> QpPlan:
        """Solve the QP of this second, from the last usable solution, shifted along.

        It is shifted by as many steps as have passed; after a reset there is none. An unusable
        result leaves that solution in place; after several in a row it may be the cause, and the
        next step starts from cold.
        """
        stages = self.preview.ahead(seen.step, seen.engine_on, seen.engine_for_s)
        t_cl_degc = seen.t_cl_degc
        if self.last is None:
            about, start = Linearisation.constant(self.preview.count, t_cl_degc), None
        else:
            x, duals = self.last.x, self.last.duals
            for _ in range(seen.step - self._last_step):
                x, duals = x[self._shift], duals[self._shift]
            about, start = self._about(x, t_cl_degc), (x, duals)
        plan = self._solve(stages, seen, about, start)
        if plan.solution.usable:
            self.last, self._last_step = plan, seen.step
            self._solves += 1
            self._failures = 0
        elif self._failures < FAILURES_FORGIVEN:
            self._failures += 1
        else:
            self._start_cold()
        return plan

    def forget(self) -> None:
        """Forget solution and preview, as after a restart of the controller under way."""
        self.preview.forget()
        if self.learned_fuel is not None:
            self.learned_fuel.forget()
            self._use(self.learned_fuel)
        self._start_cold()

    def _use(self, learned: LearnedFuel) -> None:
        """Plan with the fuel curve as it is known now."""
        curve = learned.curve
        self.model = replace(self.model, fuel=curve)
        self.qp.learn(curve)
        self._polish.learn(curve)

    def _start_cold(self) -> None:
        self.last, self._solves, self._failures = None, 0, 0

    def _about(self, x: Floats, t_cl_degc: float) -> Linearisation:
        return Linearisation.about(x, t_cl_degc, self.preview.settings)

    def _solve(
        self,
        stages: Stages,
        seen: Observation,
        about: Linearisation,
        start: tuple[Floats, Floats] | None,
        cold: bool = False,
    ) -> QpPlan:
        data = self.qp.update(stages, seen.soc, seen.t_cl_degc, about, seen.engine_on)
        if not self._is_set_up and consistent(data):
            self.solver.setup(self.qp.structure, data)
            self._is_set_up = True
        primal = dual = None
        if start is not None:
            primal = data.scaling.solver_primal(start[0].ravel())
            dual = data.scaling.solver_dual(start[1].ravel())
        if self._is_set_up:
            solution = self.solver.solve(data, primal, dual, cold=cold)
        else:
            solution = failed(data)
        if self.solver_fails:
            solution = replace(solution, status=Status.FAILED)
        if self.on_solve is not None:
            self.on_solve(Solve(data, primal, dual, cold, solution))
        return QpPlan(
            stages,
            about,
            data.scaling.primal(solution.primal).reshape(len(stages.duration_s), -1),
            data.scaling.dual(solution.dual).reshape(len(stages.duration_s), -1),
            solution,
        )


def _backend(of_qp: MhQpSettings, name: str) -> QpSolver:
    """Make the backend named in the settings; settings of another one are refused."""
    chosen = of_qp.solver or "osqp"
    if chosen == "osqp":
        return Osqp(of_qp.admm)
    section = name.replace("-", "_")
    if of_qp.admm != getattr(ControllerSettings(), section, MhQpSettings()).admm:
        raise InputError(
            f"{section}.admm has no effect with {section}.solver={chosen}: leave out one of them"
        )
    return make_solver(chosen)
