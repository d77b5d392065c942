"""The loop of every planner: its ladder rung by rung, and planners of one's own."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import BaseModel

from qpmpc import (
    Cycle,
    MhQp,
    Plan,
    Planner,
    QpmpcError,
    RecedingHorizon,
    Trip,
    load_cycle,
    simulate,
)
from qpmpc.closed_loop import drive
from qpmpc.controllers.qp_planner import FAILURES_FORGIVEN, WARM_UP_STEPS, QpPlanner
from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS
from qpmpc.controllers.rule_based import RuleBased, last_rung
from qpmpc.controllers.settings import ControllerSettings, RuleBasedSettings
from qpmpc.solvers import Status
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Observation
from qpmpc.vehicle import Command

NYCC = load_cycle("nycc")
PART = Cycle.from_samples("part", np.arange(121), NYCC.speed_mps[60:181])


class RunsOn(Planner):
    """Wants 1 W for its run to go on, and has old values in the stages behind the arrival."""

    name = "runs-on"

    def plan(self, seen: Observation) -> Plan:
        share = np.array([0.1, 0.0, 0.0, 0.52, 0.52])
        return Plan.of_means(share, 20e3 * share, arrival_s=3, least_w=1.0, stay_share=0.35)


class Failing(Osqp):
    """OSQP that fails in chosen solves on the road, and keeps what it was started from."""

    def __init__(self, failing=()) -> None:
        super().__init__()
        self.failing, self.starts = set(failing), []

    def solve(self, data, primal, dual, cold=False):
        solution = super().solve(data, primal, dual, cold)
        if cold:
            return solution
        self.starts.append(primal)
        if len(self.starts) - 1 in self.failing:
            return replace(solution, status=Status.FAILED)
        return solution


class Steady(Planner):
    """Plans the same power for `length` seconds, except in chosen seconds."""

    name = "steady"
    length, failing = 10, frozenset()

    def plan(self, seen: Observation) -> Plan:
        if seen.step in self.failing:
            return Plan.none(iterations=3)
        share = np.full(self.length, 0.8)
        return Plan.of_means(share, 8e3 + 100.0 * np.arange(self.length))


def driven(planner: Planner) -> tuple[list[str], list[Command]]:
    decisions = []
    controller = RecedingHorizon(planner.trip, planner)
    drive(planner.trip, controller, on_step=lambda _, decision: decisions.append(decision))
    return [d.fallback for d in decisions], [d.command for d in decisions]


def test_power_is_not_that_of_stages_behind_the_arrival() -> None:
    """They keep what they held before: 12 kW for the heat of an engine at idle, 0.7 g."""
    trip = Trip(PART)
    seen = trip.start._replace(engine_on=True, soc=0.6, t_cl_degc=60.0, demand_w=0.0)
    assert RecedingHorizon(trip, RunsOn(trip)).step(seen).command == Command(True, 1.0)


def test_plan_then_shifted_plan_for_some_steps_then_rules_then_plan() -> None:
    planner = Steady(Trip(PART))
    planner.length, last = 2 * PLAN_VALID_STEPS, 20 + PLAN_VALID_STEPS + 4
    planner.failing = frozenset(range(20, last))
    rungs, commands = driven(planner)
    shifted = ["shifted plan"] * PLAN_VALID_STEPS
    assert rungs[19 : last + 1] == ["", *shifted, *["rule-based"] * 4, ""]
    # the power planned for that second, while on: mean over the share
    for age, command in enumerate(commands[19:23]):
        wish = Command(True, (8e3 + 100.0 * age) / 0.8)
        seen = planner.trip.observation(19 + age, planner.trip.plant.initial_state())
        if command.p_eng_w != pytest.approx(wish.p_eng_w):  # where the battery cannot take it
            assert command.p_eng_w < wish.p_eng_w
            assert seen.demand_w < 0.0
    assert set(rungs[last:]) == {""}


def test_a_plan_is_no_longer_used_than_it_is_long() -> None:
    planner = Steady(Trip(PART))
    planner.length, planner.failing = 2, frozenset(range(20, 24))
    rungs, _ = driven(planner)
    assert rungs[19:25] == ["", "shifted plan", *["rule-based"] * 3, ""]


def test_without_any_plan_the_rules_drive_as_if_alone() -> None:
    trip = Trip(PART)
    planner = Steady(trip)
    planner.failing = frozenset(range(trip.steps))
    rungs, commands = driven(planner)
    assert set(rungs) == {"rule-based"}
    alone, rules = [], last_rung(RuleBasedSettings(), trip.vehicle)
    rules_alone = RuleBased(trip, rules=rules)
    drive(trip, rules_alone, on_step=lambda _, decision: alone.append(decision.command))
    assert commands == alone


def test_rules_of_the_last_rung_are_those_of_the_planners_settings() -> None:
    trip = Trip(PART)
    rules = RuleBasedSettings(on_w=2e3, off_w=1e3, power_min_w=12e3)
    settings = ControllerSettings(rule_based=rules)
    planner = Steady(trip, settings)
    planner.failing = frozenset(range(trip.steps))
    for run in (simulate(trip, planner), drive(trip, RecedingHorizon(trip, planner))):
        alone = drive(trip, RuleBased(trip, rules=last_rung(rules, trip.vehicle)))
        np.testing.assert_array_equal(run.trajectory.p_eng_w, alone.trajectory.p_eng_w)


def test_a_failure_of_the_solver_is_no_decision_but_its_iterations_are_told() -> None:
    planner = Steady(Trip(PART))
    planner.failing = frozenset({20})
    run = drive(planner.trip, RecedingHorizon(planner.trip, planner))
    assert run.trajectory.iterations[20] == 3
    assert np.isnan(run.trajectory.on_share[20])
    assert run.trajectory.on_share[19] == 0.8


def test_some_failures_go_on_from_the_plan_before_and_one_more_starts_cold() -> None:
    trip, first = Trip(PART), 30
    after = first + FAILURES_FORGIVEN
    forgiven, given_up = Failing(range(first, after)), Failing(range(first, after + 1))
    controllers = [MhQp(trip, solver=solver) for solver in (forgiven, given_up)]
    rungs = [drive(trip, controller).trajectory.fallback for controller in controllers]
    shifted = ["shifted plan"] * FAILURES_FORGIVEN
    assert rungs[0][first - 1 : after + 2] == ["", *shifted, "", ""]
    assert all(start is not None for start in forgiven.starts)
    # one more in a row: the next solve starts from nothing, and until it has warmed up the rules
    # drive, for as long as the old plan does not
    waiting = WARM_UP_STEPS + FAILURES_FORGIVEN - PLAN_VALID_STEPS
    expected = ["", *["shifted plan"] * PLAN_VALID_STEPS, *["rule-based"] * waiting, ""]
    assert rungs[1][first - 1 : after + 1 + WARM_UP_STEPS] == expected
    assert [k for k, start in enumerate(given_up.starts) if start is None] == [after + 1]


def test_a_planner_that_forgets_starts_cold() -> None:
    trip = Trip(PART)
    solver = Failing()
    controller = MhQp(trip, solver=solver)

    def restart(seen: Observation, _: object) -> None:
        if seen.step == 40:
            controller.forget()

    rungs = drive(trip, controller, on_step=restart).trajectory.fallback
    assert [k for k, start in enumerate(solver.starts) if start is None] == [41]
    assert rungs[40:46] == ["", *["rule-based"] * (WARM_UP_STEPS - 1), ""]
    assert controller.planner.last is not None


class OneMethod(Planner):
    """`mh-qp` once more: a planner with nothing but `plan`."""

    name = "one-method"
    inner: QpPlanner | None = None

    def plan(self, seen: Observation) -> Plan:
        if self.inner is None:
            self.inner = QpPlanner(self.trip, self.settings)
            self.inner.depart(seen)
        return self.inner.plan(seen)


def test_a_planner_of_one_method_makes_mh_qp_again_bit_for_bit() -> None:
    again = simulate("nycc", OneMethod)
    mh_qp = simulate("nycc", "mh-qp", settings={"mh_qp.implementation": "python"})
    assert (again.controller, mh_qp.controller) == ("one-method", "mh-qp")
    for name in ("p_eng_w", "soc", "t_cl_degc", "fuel_g", "on_share", "relaxation_gap"):
        np.testing.assert_array_equal(
            getattr(again.trajectory, name), getattr(mh_qp.trajectory, name), err_msg=name
        )


@pytest.mark.parametrize("other", [Trip("nycc"), Trip(PART, "prius-liion")])
def test_a_planner_of_another_trip_is_refused(other: Trip) -> None:
    planner = Steady(Trip(PART))
    for make in (lambda: RecedingHorizon(other, planner), lambda: simulate(other, planner)):
        with pytest.raises(QpmpcError, match=r"'steady' was made for .* cannot plan") as refusal:
            make()
        assert "\n" not in str(refusal.value)


def test_a_planner_may_have_another_forecast_than_the_loop() -> None:
    """As baseline-mpc does, whose preview is exact."""
    trip = Trip(PART, forecast=NYCC)
    assert RecedingHorizon(trip, Steady(trip.with_forecast(None))).trip is trip


def test_a_planner_whose_init_forgot_its_base_says_so() -> None:
    class Forgetful(Steady):
        def __init__(self, trip: Trip, settings: ControllerSettings | None = None) -> None:
            pass

    for make in (
        lambda: simulate(PART, Forgetful),
        lambda: RecedingHorizon(Trip(PART), Forgetful(Trip(PART))),
    ):
        with pytest.raises(QpmpcError, match=r"Forgetful.__init__ must call super\(\).__init__"):
            make()


def test_power_is_the_mean_over_the_share_where_an_engine_may_run() -> None:
    """Started from a share of one half on; one that runs may go on from 0.35 on."""
    plan = Plan.of_means([0.34, 0.4, 0.5, 0.8, 1.0, 1.001], [4e3, 4e3, 4e3, 8e3, 9e3, 9e3])
    np.testing.assert_allclose(plan.power_on_w, [0.0, 10e3, 8e3, 10e3, 9e3, 9e3])
    assert plan.usable
    assert not Plan.none().usable


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (None, r"plan returned None at 0 s, where a Plan is needed; Plan.none\(\)"),
        (Command(True, 5e3), r"plan returned Command"),
        (Plan(np.ones(3), np.ones(2)), "has 3 on-shares and 2 powers"),
        (Plan(np.empty(0), np.empty(0)), "has 0 on-shares"),
    ],
)
def test_what_is_no_plan_is_one_line(made: object, said: str) -> None:
    class Broken(Planner):
        def plan(self, seen: Observation) -> Plan:
            return made

    with pytest.raises(QpmpcError, match=f"broken: .*{said}") as refusal:
        simulate(PART, Broken)
    assert "\n" not in str(refusal.value)


def test_a_plan_that_is_not_finite_does_not_drive_and_the_run_says_so() -> None:
    class Wild(Planner):
        def plan(self, seen: Observation) -> Plan:
            return Plan.of_means([1.0, 1.0], [float("nan"), 5e3])

    run = simulate(PART, Wild)
    assert set(run.trajectory.fallback) == {"rule-based"}
    of_the_battery, *remarks = run.summary()["remarks"]
    assert of_the_battery.startswith("the battery's power limits are 83 %")
    assert remarks[:2] == [
        "wild: no plan at 0 s: the plan is not finite",
        "wild: rule-based drove in 120 of 120 s, first at 0 s",
    ]


def test_a_planner_has_its_own_settings() -> None:
    class PowerSettings(BaseModel):
        power_w: float = 6e3

    class ManyWatts(Planner):
        Settings = PowerSettings

        def plan(self, seen: Observation) -> Plan:
            return Plan.of_means([1.0], [self.own_settings().power_w])

    run = simulate(PART, ManyWatts, settings={"many_watts.power_w": 9e3})
    assert run.controller == "many-watts"
    assert run.trajectory.p_eng_w.max() == 9e3


def test_after_a_reset_the_run_has_its_own_remarks() -> None:
    class Wild(Planner):
        def plan(self, seen: Observation) -> Plan:
            return Plan.none("no time")

    trip = Trip(PART)
    controller = RecedingHorizon(trip, Wild(trip))
    controller.remarks.append("made by hand")
    first = simulate(trip, controller).remarks
    controller.reset()
    assert simulate(trip, controller).remarks == first
    assert first[1:3] == ("made by hand", "wild: no plan at 0 s: no time")
