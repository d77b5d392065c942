"""The receding-horizon loop: plan, realise on/off, keep safe, degrade in steps. Written once."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.controllers.base import (
    Controller,
    Decision,
    Driver,
    Progress,
    Receive,
    base_not_called,
)
from qpmpc.controllers.monitor import NOTHING_WRONG, Flag
from qpmpc.controllers.realise import ON_THRESHOLD, engine_runs, power_while_on_w, second_of_power
from qpmpc.controllers.rule_based import RuleBased, last_rung
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import QpmpcError
from qpmpc.preview.checked import CheckedPreview, NoPreviewError
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import Command

PLAN_VALID_STEPS = 10  # how many steps an old plan may drive before the rules take over


@dataclass(frozen=True)
class Plan:
    """The plan for the seconds ahead.

    Attributes
    ----------
    on_share : sigma, share of each second with the engine on, shape (n,), n >= 1
    power_on_w : engine power while it is on, shape (n,)
    usable : whether it may be applied
    reason : why not, in a few words
    flags : why not, in the terms of the ladder
    iterations : taken by the solver
    relaxation_gap : slack of the relaxation at the first second, relative; nan if there is none
    arrival_s : second of the plan in which the trip ends; None where it ends later
    least_w : engine power that the first second needs at least, see `ramp`, `empty_battery`,
        `battery_run`, `short_run` and `heating_run` in `qpmpc.controllers`, `last_run` in
        `qpmpc.qp`
    certificate_g : cost of the plan less a proven lower bound on that of any; nan without one
    fast_s : first second of the plan that is too fast for an engine that is off; None without one
    stay_share : share from which on a run may go on, see `qpmpc.controllers.realise`: `STAY_SHARE`
        for those of a relaxed program in which only a start lets one rise
    """

    on_share: NDArray[np.float64]
    power_on_w: NDArray[np.float64]
    usable: bool = True
    iterations: int = 0
    relaxation_gap: float = float("nan")
    reason: str = ""
    flags: Flag = NOTHING_WRONG
    arrival_s: int | None = None
    least_w: float = 0.0
    certificate_g: float = float("nan")
    fast_s: int | None = None
    stay_share: float = ON_THRESHOLD

    @classmethod
    def of_means(
        cls,
        on_share: ArrayLike,
        p_eng_w: ArrayLike,
        arrival_s: int | None = None,
        least_w: float = 0.0,
        fast_s: int | None = None,
        stay_share: float = ON_THRESHOLD,
    ) -> "Plan":
        """Return the plan of mean engine powers E = sigma P_on; shape (n,) each."""
        share, mean_w = np.asarray(on_share, dtype=float), np.asarray(p_eng_w, dtype=float)
        power_on_w = power_while_on_w(share, mean_w)
        return cls(
            share,
            power_on_w,
            arrival_s=arrival_s,
            least_w=least_w,
            fast_s=fast_s,
            stay_share=stay_share,
        )

    @classmethod
    def none(
        cls, reason: str = "", iterations: int = 0, flags: Flag = Flag.SOLVER_FAILED
    ) -> "Plan":
        """Return the result of a planner that has found no plan, and why."""
        return cls(np.empty(0), np.empty(0), False, iterations, reason=reason, flags=flags)


class Planner(Driver, ABC):
    """Plans the engine over the seconds ahead, once a second; `RecedingHorizon` does the rest.

    A subclass implements `plan`. If it returns an unusable plan, such as `Plan.none()`, the ladder
    of `RecedingHorizon` takes over.

    Parameters
    ----------
    trip : data that the planner may use: `trip.vehicle`, and the trip ahead through
        `qpmpc.preview.StageBuilder`
    settings : as of `Driver`
    """

    def depart(self, seen: Observation) -> None:
        """Prepare the first plan before the trip starts, and forget any earlier trip."""

    @abstractmethod
    def plan(self, seen: Observation) -> Plan:
        """Plan from the measured state on."""

    def forget(self) -> None:
        """Forget plan and warm start, as after a restart of the ECU under way."""


class RecedingHorizon(Controller):
    """Drives by a planner: its plan, else its last plan shifted, else the rules.

    The rules are evaluated every second, so that their timers are right if they take over. The
    safety layer has the last word in any case.

    Parameters
    ----------
    trip : to be driven
    planner : made for the same trip; its forecast may be another one
    settings : of all controllers; `rule_based` has the thresholds of the last rung; the planner's
        if None

    Raises
    ------
    QpmpcError
        If the planner was made for another trip.
    """

    def __init__(self, trip: Trip, planner: Planner, settings: SettingsLike | None = None) -> None:
        if not hasattr(planner, "trip") or not hasattr(planner, "settings"):
            raise base_not_called(planner)
        if not trip.same_road_as(planner.trip):
            raise QpmpcError(
                f"planner {planner.name!r} was made for {planner.trip!r} and cannot plan {trip!r}: "
                "make one for this trip"
            )
        super().__init__(trip, settings or planner.settings)
        self.planner = planner
        if type(self) is RecedingHorizon:  # a subclass has its own
            self.name = planner.name
        self.solver_name = planner.solver_name
        rules = last_rung(self.settings.rule_based, trip.vehicle)
        learned = getattr(planner, "learned_fuel", None)
        self.reads_fuel = learned is not None
        self.monitor.fuel_most_g = None if learned is None else learned.most_g
        self._rules = RuleBased(trip, self.settings, rules)
        self._old: Plan | None = None
        self._old_step = 0
        self._has_reason = False

    def depart(self, progress: Progress | None = None) -> None:
        """Prepare the planner's first plan."""
        self._rules.depart()
        self._old, self._has_reason = None, False
        with suppress(NoPreviewError):  # then it starts from cold, under way
            self.planner.depart(self.trip.start)
        self.expects = self.planner.expects

    def step(self, seen: Observation) -> Decision:
        """Run one step: the plan, else the shifted last plan, else the rules."""
        ruled = self._rules.step(seen)
        plan = self._plan(seen)
        self.expects = self.planner.expects  # one that plans nothing at departure: of its first
        flags = plan.flags
        preview = getattr(self.planner, "preview", None)
        if isinstance(preview, CheckedPreview) and preview.was_bad:
            flags |= Flag.BAD_PREVIEW
        if plan.usable:
            self._old, self._old_step = plan, seen.step
            gap, on_share = plan.relaxation_gap, float(plan.on_share[0])
            command = self._realised(plan, 0, seen)
            return Decision(command, "", plan.iterations, gap, on_share, flags, plan.certificate_g)
        command, rung = ruled, "rule-based"
        age = seen.step - self._old_step
        if self._old is not None and age < min(PLAN_VALID_STEPS + 1, len(self._old.on_share)):
            command, rung = self._realised(self._old, age, seen), "shifted plan"
        return Decision(command, rung, plan.iterations, flags=flags)

    def _plan(self, seen: Observation) -> Plan:
        """Plan of this second; none where there is no preview."""
        self.planner.solver_fails = self.solver_fails
        try:
            plan = self._checked(self.planner.plan(seen), seen.step)
        except NoPreviewError:
            return Plan.none(flags=Flag.BAD_PREVIEW)
        if self.solver_fails and plan.usable:  # a planner that knows of no injection
            return Plan.none(iterations=plan.iterations)
        return plan

    def _realised(self, plan: Plan, second: int, seen: Observation) -> Command:
        """On or off, at the power of the next second before arrival in which the plan runs."""
        # stages behind the arrival keep what they held before
        last = None if plan.arrival_s is None else max(plan.arrival_s, second + 1)
        ahead = plan.on_share[second:last]
        arrival_s = None if plan.arrival_s is None else plan.arrival_s - second
        fast_s = None if plan.fast_s is None else plan.fast_s - second
        least_w = plan.least_w if second == 0 else 0.0
        vehicle, stay_share = self.trip.vehicle, plan.stay_share
        if not engine_runs(ahead, arrival_s, seen, vehicle, least_w, fast_s, stay_share):
            return Command(False, 0.0)
        running_w = float(plan.power_on_w[second + second_of_power(ahead, stay_share)])
        return Command(True, max(running_w, least_w))

    def _checked(self, plan: Plan, second: int) -> Plan:
        """Refuse what is no plan; take one that is not finite as unusable."""
        if not isinstance(plan, Plan):
            raise QpmpcError(
                f"{self.name}: plan returned {plan!r} at {second} s, where a Plan is needed; "
                "Plan.none() where there is none"
            )
        if plan.usable and not 1 <= len(plan.on_share) == len(plan.power_on_w):
            raise QpmpcError(
                f"{self.name}: the plan at {second} s has {len(plan.on_share)} on-shares and "
                f"{len(plan.power_on_w)} powers, where one or more of each are needed"
            )
        if plan.usable and not (
            np.isfinite(plan.on_share).all() and np.isfinite(plan.power_on_w).all()
        ):
            plan = Plan.none("the plan is not finite", plan.iterations)
        if plan.reason and not self._has_reason:
            self._has_reason = True
            self.remarks.append(f"{self.name}: no plan at {second} s: {plan.reason}")
        return plan

    def inject(
        self, hearing: Callable[[Receive], Receive] | None, solver: bool = False
    ) -> frozenset[str]:
        """Prepare the planner for faults; see `Controller.inject`."""
        self.planner.solver_fails = False
        preview = getattr(self.planner, "preview", None)
        if not isinstance(preview, CheckedPreview):
            return frozenset({"solver"})
        right = preview.source.preview
        preview.receive = right if hearing is None else hearing(right)
        return frozenset({"preview", "solver"})

    def forget(self) -> None:
        """Forget measurements, plan, warm start and the rules' memory, as after a restart."""
        super().forget()
        self.planner.forget()
        self._rules.depart()
        self._old = None
