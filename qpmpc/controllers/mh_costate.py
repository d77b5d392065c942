"""`mh-costate`: plans by costates of SOC and coolant on the true curves; see docs/costate.md."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator

from qpmpc.controllers.coming_second import Coming, least_w, most_w
from qpmpc.controllers.ramp import RampFloor
from qpmpc.controllers.receding_horizon import Plan, Planner
from qpmpc.controllers.settings import SettingsLike
from qpmpc.costate.certificate import Followed, Layout, choose, follow, violation_price_g
from qpmpc.costate.dual import Dual, Multipliers, StageCosts, smoothed, stage_prices
from qpmpc.costate.path import Shortest
from qpmpc.costate.program import USUAL_CHARGE, Program, ProgramBuilder, unit_g
from qpmpc.costate.solve import newton
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.pwa.priced import Least, StagePrices, going
from qpmpc.qp.expectation import expectation
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import Var, table_of
from qpmpc.qp.settings import LimitSettings
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine_parameters import Engine

Floats = NDArray[np.float64]

DEPARTURE_LINEARISATIONS, DEPARTURE_ROUNDS = 5, 30
ROUNDS, START_ROUNDS = 3, 4
EXPANSION_STEP = 0.2  # a second, of the way from what was expanded about to the plan
MOST_CHARGE = 10.0  # the largest lambda allowed, in fuel of the engine at its best


class MhCostateSettings(BaseModel):
    """Settings of `mh-costate`; dotted names such as `mh_costate.rounds`.

    Attributes
    ----------
    horizon : layout of the stages, as of `mh_qp`, but `entry_share` is 0: blocks are apart
    limits : terminal band and margins, as of `mh_qp.qp`; it comes nearer to a limit than an
        iteration that is stopped, and needs less of a margin to it
    rounds : Newton rounds of a second; if not given 3, or 4 where a start costs something; the
        search goes on from second to second
    implementation : as of `mh_qp`
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    horizon: HorizonSettings = HorizonSettings(blocks=20, entry_share=0.0)
    limits: LimitSettings = LimitSettings(t_cl_margin_k=0.1)
    rounds: Annotated[int, Field(ge=1, le=1000)] | None = None
    implementation: Literal["auto", "c", "python"] = "auto"

    @field_validator("horizon")
    @classmethod
    def _apart(cls, horizon: HorizonSettings) -> HorizonSettings:
        if horizon.entry_share:
            raise ValueError(
                "entry_share must be 0, not as of mh_qp: its blocks share prices alone"
            )
        return horizon

    def rounds_of(self, engine: Engine) -> int:
        """Return the rounds of a second with this engine."""
        if self.rounds is not None:
            return self.rounds
        return START_ROUNDS if table_of(engine).has_start else ROUNDS


def most_charge_g(model: PwaModel) -> float:
    """Return the largest lambda allowed, g."""
    return MOST_CHARGE * unit_g(model)


@dataclass(frozen=True)
class CostatePlan:
    """Solution of one second.

    Attributes
    ----------
    stages, program : that it is of
    at : multipliers of the limits
    share : sigma of the smoothed dual, shape (n,)
    power_w : while on, where there is a choice, shape (n,)
    followed : the plan, with on or off in the seconds ahead
    bound_g : no plan of this program costs less
    x : of the plan, columns as in `Var`, shape (n, len(Var))
    coming : what the rules of the coming second know of it
    """

    stages: Stages
    program: Program
    at: Multipliers
    share: Floats
    power_w: Floats
    followed: Followed
    bound_g: float
    x: Floats
    coming: Coming

    @property
    def certificate_g(self) -> float:
        """By how much the plan may at most be improved."""
        return self.followed.cost_g - self.bound_g


class MhCostate(Planner):
    """Multi-horizon MPC by costates: the stages of `mh-qp`, each minimised exactly.

    Parameters
    ----------
    trip, settings : as of `Planner`
    """

    name = "mh-costate"
    solver_name = "costate newton"
    Settings = MhCostateSettings

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        super().__init__(trip, settings)
        own = self.own_settings()
        assert isinstance(own, MhCostateSettings)
        vehicle = trip.vehicle
        self._horizon, self._rounds = own.horizon, own.rounds_of(vehicle.engine)
        self.preview = trip.preview(own.horizon)
        self.model = PwaModel.of(vehicle)
        self._most_charge_g = most_charge_g(self.model)
        self.programs = ProgramBuilder(
            vehicle, self.model, self.preview.count, own.limits, own.horizon
        )
        self._ramp, self._maps = RampFloor(vehicle), BatteryMaps(vehicle.battery)
        self._shift = self.preview.shift()
        self._shortest = Shortest.of(vehicle.engine)
        self.last: CostatePlan | None = None
        self._last_step = 0
        self._expands: Floats = np.empty(0)  # as `x`: what the next second is expanded about

    def depart(self, seen: Observation) -> None:
        """Solve the program of departure, with several linearisations."""
        self.forget()
        self.expects = None
        stages = self.preview.ahead(seen.step, seen.engine_on, seen.engine_for_s)
        about, start = self._cold(seen.t_cl_degc)
        for _ in range(DEPARTURE_LINEARISATIONS):
            plan = self._solve(stages, seen, about, start, DEPARTURE_ROUNDS)
            about, start = self._about(plan.x, seen.t_cl_degc), plan.at
        self.last, self._last_step, self._expands = plan, seen.step, plan.x
        self.expects = expectation(self.trip, self._horizon, self.model, stages, plan.x)

    def plan(self, seen: Observation) -> Plan:
        """Plan with the solution of this second's program."""
        solved = self.solve(seen)
        if self.solver_fails:
            return Plan.none(iterations=self._rounds)
        short, vehicle, coming = self._horizon.short_stages, self.trip.vehicle, solved.coming
        ramp_w = self._ramp.least_w(solved.stages.seconds_w(short), seen.soc)
        room_w = most_w(vehicle, self._maps, coming, seen)
        power_w = solved.power_w[:short].copy()
        power_w[0] = min(power_w[0], room_w)
        of_plan = (self._maps, solved.program.shared, coming)
        return Plan(
            solved.share[:short],
            power_w,
            iterations=self._rounds,
            arrival_s=solved.stages.arrival_s(short),
            least_w=least_w(vehicle, *of_plan, seen, ramp_w, room_w),
            certificate_g=solved.certificate_g,
            fast_s=solved.stages.fast_s(short, vehicle),
        )

    def solve(self, seen: Observation) -> CostatePlan:
        """Solve the program of this second, from the last plan, shifted along.

        Without one, as after a restart under way, from a guess: a round makes a usable plan of it.
        The point of expansion follows the plan by `EXPANSION_STEP`: far from its best a plan may
        have the thermostat open where it is closed, and the program about it would be another one
        every second, which the search never catches up with.
        """
        stages = self.preview.ahead(seen.step, seen.engine_on, seen.engine_for_s)
        about, start = self._cold(seen.t_cl_degc)
        part = 1.0
        if self.last is not None:
            part = EXPANSION_STEP
            x, charge, heat = self._expands, self.last.at.charge, self.last.at.heat
            for _ in range(seen.step - self._last_step):
                x, charge, heat = x[self._shift], charge[self._shift], heat[self._shift]
                heat[self._horizon.short_stages - 1] = 0.0  # a second's own: it is there once
            about, start = self._about(x, seen.t_cl_degc), Multipliers(charge, heat)
        plan = self._solve(stages, seen, about, start, self._rounds)
        if not self.solver_fails:
            self.last, self._last_step = plan, seen.step
            self._expands = about.towards(plan.x, part)
        return plan

    def forget(self) -> None:
        """Forget preview and plan, as after a restart of the controller under way."""
        self.preview.forget()
        self.last = None

    def _about(self, x: Floats, t_cl_degc: float) -> Linearisation:
        return Linearisation.about(x, t_cl_degc, self._horizon)

    def _cold(self, t_cl_degc: float) -> tuple[Linearisation, Multipliers]:
        n = self.preview.count
        charge = np.full(n, USUAL_CHARGE * unit_g(self.model))
        return Linearisation.constant(n, t_cl_degc), Multipliers(charge, np.zeros(n))

    def _solve(
        self,
        stages: Stages,
        seen: Observation,
        about: Linearisation,
        start: Multipliers,
        rounds: int,
    ) -> CostatePlan:
        state = (seen.soc, seen.t_cl_degc, about, seen.engine_on)
        program = smoothed(self.programs.at(stages, *state), start)
        found = newton(program, start, rounds, self._most_charge_g)
        layout = Layout.of(stages, self._horizon, self._shortest, seen.engine_for_s)
        exact = StageCosts.of(program, found.at, program.curves)
        costs = found.costs.with_first(layout.short, exact)
        choice = choose(program, found.at, costs, layout)
        share = found.share.copy()
        share[: layout.seconds] = choice.path.runs
        price = violation_price_g(found.at)
        power_w, forced_w = costs.on.power_w, costs.forced.power_w
        followed = follow(program, share, power_w, forced_w, layout.short, price)
        x = np.zeros((len(share), len(Var)))
        x[:, Var.SOC], x[:, Var.T_CL] = followed.soc, followed.t_cl_degc
        x[:, Var.ON], x[:, Var.START] = followed.on_share, followed.starts
        x[:, Var.P_ENG], x[:, Var.FUEL] = followed.power_w, followed.fuel_g_per_s
        x[:, Var.INTERNAL] = followed.internal_w
        coming = _coming(stages, program, found, costs, x)
        of_dual = (found.at, found.share, power_w)
        return CostatePlan(stages, program, *of_dual, followed, choice.bound_g, x, coming)


def _coming(stages: Stages, program: Program, found: Dual, costs: StageCosts, x: Floats) -> Coming:
    """Return what the rules of the coming second know of a plan: each second at its own prices."""
    short = program.short
    prices = stage_prices(program, found.at, costs.nu)
    seconds = StagePrices(*(each[:short] for each in prices))
    on = Least(*(each[:short] for each in costs.on))
    ahead = going(on, stages.internal_off_w[:short], seconds)
    fuel, store = float(prices.fuel[0]), float(prices.internal[0])
    of_plan = (stages, x[:, Var.ON], x[:, Var.INTERNAL], found.share[:short], ahead)
    return Coming(*of_plan, fuel, store)
