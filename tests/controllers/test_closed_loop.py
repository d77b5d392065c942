"""Closed loops on real cycles: fuel, limits, the degradation ladder, determinism."""

import numpy as np
import pytest
from plain import plain_car

from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.qp_planner import FAILURES_FORGIVEN, WARM_UP_STEPS
from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.errors import InputError
from qpmpc.registry import controller_names, make_controller, split_settings
from qpmpc.simulation import simulate
from qpmpc.solvers import QpSolution, Status
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle

NO_VIOLATION = {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}


@pytest.fixture(scope="module")
def runs():
    names = ("nycc", "nedc-truncated")
    return {
        (cycle, controller): simulate(load_cycle(cycle), controller, load_vehicle())
        for cycle in names
        for controller in ("rule-based", "mh-qp", "mh-qp-paper")
    }


@pytest.mark.parametrize(("cycle", "saving"), [("nycc", 0.20), ("nedc-truncated", 0.025)])
def test_mh_qp_saves_against_the_rules(runs, cycle, saving):
    rules, mpc = runs[cycle, "rule-based"], runs[cycle, "mh-qp"]
    assert rules.comparable
    assert mpc.comparable
    assert mpc.fuel_soc_balanced_g <= (1.0 - saving) * rules.fuel_soc_balanced_g


@pytest.mark.parametrize(
    "starts",
    [{"engine.start_fuel_g": 0.3}, {"engine.start_fuel_g": 0.2, "engine.start_energy_j": 4e3}],
)
def test_starts_that_cost_something_are_planned(starts):
    """Half the starts for less fuel than the plan that knows of none; alike in Python and C."""
    blind = simulate("nycc", "mh-qp", "paper-nimh")
    seeing = simulate("nycc", "mh-qp", "paper-nimh", settings=starts)
    engine, trip = seeing.vehicle.engine, seeing.vehicle.trip
    price_g = engine.start_fuel_g + engine.start_energy_j / (trip.eta_eq * engine.lhv_j_per_g)
    in_python = {**starts, "mh_qp.implementation": "python"}
    same = simulate("nycc", "mh-qp", "paper-nimh", settings=in_python)
    assert 0 < seeing.trajectory.started.sum() <= 0.6 * blind.trajectory.started.sum()
    blindly_g = blind.fuel_soc_balanced_g + price_g * blind.trajectory.started.sum()
    assert seeing.fuel_soc_balanced_g < 0.98 * blindly_g
    assert seeing.summary()["violations"] == NO_VIOLATION
    assert same.trajectory.p_eng_w == pytest.approx(seeing.trajectory.p_eng_w, abs=0.1)


def test_no_limit_is_violated_and_no_fallback_is_used(runs):
    for run in runs.values():
        summary = run.summary()
        assert summary["violations"] == NO_VIOLATION
        assert summary["fallback_steps"] == 0


@pytest.mark.parametrize("cycle", ["udds", "hwfet", "wltc-3b"])
def test_longer_cycles_stay_within_limits(cycle):
    summary = simulate(load_cycle(cycle), "mh-qp", load_vehicle()).summary()
    assert summary["violations"] == NO_VIOLATION
    assert summary["comparable"]


# Once a kelvin or two over 90 degC there, with a radiator of 150 W/K: the plan took the radiator
# for as open as it liked. The small battery is at its lower limit before the motorway ends, and the
# engine has to give the rest: 0.65 K too much, which dynamic programming avoids. The price of a
# start makes 0.18 K of that: with
# the engine of the paper it is 0.47 K, with a ramp and shortest runs and rests besides 0.50 K. With
# SOC limited inside blocks too it is nil, but a trip that begins at a low SOC then takes 2.4 % more
# fuel (train-095).
@pytest.mark.parametrize(
    ("car", "excess_k"),
    [
        (plain_car(), 0.0),
        (plain_car("paper-liion"), 0.66),
        (load_vehicle("paper-liion"), 0.5),
    ],
    ids=["nimh", "liion", "paper-liion"],
)
def test_hot_coolant_in_mild_weather_keeps_its_limit(car, excess_k):
    car = car.with_settings({"thermal.t_amb_degc": 10.0})
    summary = simulate(load_cycle("wltc-3b"), "mh-qp", car).summary()
    assert summary["t_cl_max_degc"] > 89.0  # else nothing would be tested
    assert summary["violations"].pop("t_cl_degc") <= excess_k
    assert not any(summary["violations"].values())
    assert summary["fallback_steps"] == 0


def test_the_relaxation_is_tight_and_nearly_integral(runs):
    summary = runs["nycc", "mh-qp"].summary()
    assert summary["relaxation_gap"]["mean"] < 0.04  # 30 iterations, not a converged solution
    assert summary["sigma_integral_share"] > 0.95


def test_charge_is_sustained(runs):
    for run in runs.values():
        # The battery's last seconds are decided a second at a time: one engine burst, 0.5 %.
        assert run.trajectory.soc[-1] == pytest.approx(0.6, abs=0.005)


def test_colder_weather_costs_more_fuel():
    fuel = [
        simulate(
            load_cycle("nycc"), "mh-qp", load_vehicle().with_settings({"thermal.t_amb_degc": t})
        ).fuel_soc_balanced_g
        for t in (-15.0, -7.0, 10.0)
    ]
    assert fuel[0] > fuel[1] > fuel[2]


def test_a_run_repeats_bit_for_bit(runs):
    again = simulate(load_cycle("nycc"), "mh-qp", load_vehicle())
    before = runs["nycc", "mh-qp"].trajectory
    np.testing.assert_array_equal(again.trajectory.fuel_g, before.fuel_g)
    np.testing.assert_array_equal(again.trajectory.soc, before.soc)


class Flaky(Osqp):
    """OSQP that fails in chosen solves (counted after the departure)."""

    def __init__(self, failing):
        super().__init__()
        self._failing, self._count = failing, 0

    def solve(self, data, primal, dual, cold=False):
        solution = super().solve(data, primal, dual, cold)
        if cold:
            return solution
        self._count += 1
        if self._count in self._failing:
            nothing = np.full_like(solution.primal, np.nan)
            return QpSolution(nothing, solution.dual, Status.FAILED, 0, 0.0)
        return solution


def _with_solver(cycle, solver):
    trip = Trip(cycle, load_vehicle())
    return simulate(trip, MhQp(trip, solver=solver))


def test_one_failure_is_bridged_by_the_shifted_plan():
    run = _with_solver(load_cycle("nycc"), Flaky({50, 51, 200}))
    used = [(t, rung) for t, rung in enumerate(run.trajectory.fallback) if rung]
    assert {rung for _, rung in used} == {"shifted plan"}
    assert run.summary()["violations"] == NO_VIOLATION


def test_failures_beyond_those_forgiven_cost_the_plan():
    # one more than is forgiven: cold from the next step on
    count = FAILURES_FORGIVEN + 1
    run = _with_solver(load_cycle("nycc"), Flaky({*range(50, 50 + count)}))
    rungs = run.trajectory.fallback[49 : 49 + count + WARM_UP_STEPS + 1]
    # the old plan drives as long as it is valid, then the rules until enough solves since the reset
    rules = ["rule-based"] * (count + WARM_UP_STEPS - 1 - PLAN_VALID_STEPS)
    assert list(rungs) == ["shifted plan"] * PLAN_VALID_STEPS + rules + [""] * 2
    assert run.summary()["violations"] == NO_VIOLATION


class Dead(Osqp):
    """A solver that never gives a usable answer."""

    def solve(self, data, primal, dual, cold=False):
        return QpSolution(np.full_like(data.q, np.nan), data.lower, Status.INFEASIBLE, 0, 0.0)


def test_a_dead_solver_leaves_the_rules_in_charge():
    run = _with_solver(load_cycle("nycc"), Dead())
    assert set(run.trajectory.fallback) == {"rule-based"}
    assert run.summary()["violations"] == NO_VIOLATION
    assert run.summary()["fallback_steps"] == 598


def test_rules_alone_end_where_they_began():
    run = simulate(load_cycle("udds"), "rule-based", load_vehicle("prius-liion"))
    assert run.comparable
    unbalanced = ControllerSettings().with_settings({"rule_based.balance": False})
    raw = simulate(load_cycle("nycc"), "rule-based", load_vehicle(), settings=unbalanced)
    assert not raw.comparable  # 17 % of its fuel went into the battery


def test_names_and_settings():
    assert controller_names()[0] == "mh-qp"
    with pytest.raises(InputError, match="rule-based"):
        make_controller("rules", Trip("nycc"))
    vehicle, controllers = split_settings({"trip.soc_init": 0.5, "mh_qp.admm.iterations": 25})
    assert vehicle == {"trip.soc_init": 0.5}
    assert controllers == ControllerSettings().with_settings({"mh_qp.admm.iterations": 25})
    assert controllers.mh_qp.admm.iterations == 25
    for bad in ("nonsense.x", "name"):
        with pytest.raises(InputError, match=bad):
            split_settings({bad: 1})
    with pytest.raises(InputError, match="mh_qp"):
        ControllerSettings().with_settings({"mh_qp": 1})
    with pytest.raises(InputError, match="iterations"):
        ControllerSettings().with_settings({"mh_qp.admm.iterations": 0})
