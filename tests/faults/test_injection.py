"""What a controller gets under a fault, and what becomes of its commands."""

import math

import numpy as np
import pytest

from qpmpc import Command, Controller, Decision, InputError, Plan, Planner, Trip, simulate
from qpmpc.closed_loop import drive
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.faults.alter import altered_preview
from qpmpc.faults.models import Fault, as_faults
from qpmpc.preview.horizon import HorizonSettings

AT_S, FOR_S = 50, 3


class Watch(Controller):
    """Notes what it is shown; its commands tell the second."""

    name = "watch"
    has_monitor = has_safety_layer = True

    def __init__(self, trip, settings=None):
        super().__init__(trip, settings)
        self.shown, self.resets = [], 0

    def step(self, seen):
        self.shown.append(seen)
        return Command(True, 5000.0 + seen.step)

    def forget(self):
        self.resets += 1


@pytest.fixture(scope="module")
def nycc():
    return Trip("nycc")


def watched(trip, **fault):
    made = Watch(trip)
    truth = []
    run = drive(
        trip,
        made,
        faults=as_faults([{"at_s": AT_S, "for_s": FOR_S, **fault}]),
        on_step=lambda seen, _: truth.append(seen),
    )
    return made, truth, run


@pytest.mark.parametrize("signal", ["soc", "t_cl_degc", "demand_w", "speed_mps"])
def test_a_measured_signal_is_wrong_in_the_seconds_of_the_fault_only(nycc, signal):
    expected = {
        ("nan", None): lambda true, k: math.nan,
        ("offset", 0.5): lambda true, k: true[AT_S + k] + 0.5,
        ("drift", 0.5): lambda true, k: true[AT_S + k] + 0.5 * (k + 1),
        ("stuck", None): lambda true, k: true[AT_S],
        ("jump", 0.5): lambda true, k: 0.5,
        ("delay", 2): lambda true, k: true[AT_S + k - 2],
    }
    for (kind, value), shows in expected.items():
        fault = {"kind": kind, "signal": signal, "value": value}
        made, truth, run = watched(nycc, **fault)
        true = [getattr(seen, signal) for seen in truth]
        shown = [getattr(seen, signal) for seen in made.shown]
        for k in range(FOR_S):
            assert shown[AT_S + k] == pytest.approx(shows(true, k), nan_ok=True), kind
        assert shown[:AT_S] + shown[AT_S + FOR_S :] == true[:AT_S] + true[AT_S + FOR_S :]
        np.testing.assert_array_equal(run.trajectory.demand_w, nycc.truth.demand_w)


def test_the_clock_and_the_engine_signal(nycc):
    def shown(**fault):
        return watched(nycc, **fault)[0].shown[AT_S : AT_S + FOR_S]

    assert [s.step for s in shown(kind="offset", signal="second", value=-5)] == [45, 46, 47]
    assert [s.step for s in shown(kind="stuck", signal="second")] == [50, 50, 50]
    seen = shown(kind="jump", signal="engine_on", value=0)
    assert [s.engine_on for s in seen] == [False] * 3  # though it runs
    assert all(type(s.engine_on) is bool and type(s.step) is int for s in seen)


def test_faults_of_one_signal_act_one_after_the_other(nycc):
    made = Watch(nycc)
    both = [
        {"kind": "jump", "signal": "soc", "value": 0.2, "at_s": 3},
        {"kind": "offset", "signal": "soc", "value": 0.1, "at_s": 3},
    ]
    drive(nycc, made, faults=as_faults(both))
    assert made.shown[3].soc == pytest.approx(0.3)


def test_missed_repeated_and_reset(nycc):
    made, _, run = watched(nycc, kind="missed-second")
    assert AT_S not in [seen.step for seen in made.shown]
    assert run.trajectory.p_eng_w[AT_S : AT_S + FOR_S].tolist() == [5000.0 + AT_S - 1] * FOR_S
    assert run.trajectory.fallback[AT_S : AT_S + FOR_S] == ["last command"] * FOR_S
    assert run.trajectory.p_eng_w[AT_S + FOR_S] == 5000.0 + AT_S + FOR_S
    made, _, _ = watched(nycc, kind="repeated-second")
    assert [seen.step for seen in made.shown][AT_S : AT_S + 4] == [50, 50, 51, 51]
    assert watched(nycc, kind="reset")[0].resets == FOR_S


def test_a_late_command_is_that_of_seconds_before(nycc):
    power_w = watched(nycc, kind="late", value=2)[2].trajectory.p_eng_w
    assert power_w[AT_S - 1 : AT_S + FOR_S + 1].tolist() == [
        5000.0 + t for t in (49, 48, 49, 50, 53)
    ]


def preview_under(nycc, kind, second=AT_S + 1, value=None):
    source = nycc.preview(HorizonSettings()).source
    fault = Fault(kind=kind, at_s=AT_S, for_s=FOR_S, value=value)
    now = source.preview(second)
    return now, altered_preview(fault, second, source.preview(AT_S), now)


def test_faulty_previews(nycc):
    now, wild = preview_under(nycc, "wild")
    assert np.abs(wild.short_demand_w).max() > 1e5  # no car can do that
    assert all(np.isfinite(field).all() for field in (wild.short_demand_w, wild.long.net_w))
    assert preview_under(nycc, "wild")[1].short_demand_w.tolist() == wild.short_demand_w.tolist()
    assert preview_under(nycc, "missing")[1].short_count == 0
    now, stale = preview_under(nycc, "stale")
    assert stale.short_demand_w[1:].tolist() == now.short_demand_w[:-1].tolist()


def test_a_preview_of_a_shorter_and_a_longer_trip(nycc):
    for value in (1, 30, 200):
        now, early = preview_under(nycc, "too-short", value=value)
        _, late = preview_under(nycc, "too-long", value=value)
        true_s = now.long.duration_s.sum()
        assert early.long.duration_s.sum() == pytest.approx(true_s - value)
        assert late.long.duration_s.sum() == pytest.approx(true_s + value)
        assert early.long.duration_s[0] == now.long.duration_s[0]  # what is near stays
    _, over = preview_under(nycc, "too-short", value=10_000)
    assert (over.short_count, over.long.duration_s.sum()) == (0, 0.0)  # arrived, it says
    now, near = preview_under(nycc, "too-short", 590, 3)  # 8 s before the arrival
    assert (now.short_count, near.short_count) == (8, 5)
    assert preview_under(nycc, "too-long", 590, 3)[1].short_count == 11


def test_the_preview_is_that_of_the_true_second_whatever_the_clock_says(nycc):
    heard = []
    planner = QpPlanner(nycc)
    right = planner.preview.source.preview
    planner.preview.source.preview = lambda step: heard.append(step) or right(step)
    faults = as_faults([{"kind": "offset", "signal": "second", "value": -9, "at_s": 5, "for_s": 9}])
    drive(nycc, RecedingHorizon(nycc, planner), faults=faults)
    assert heard[1:] == list(range(nycc.steps))  # after that of the departure


@pytest.mark.slow
def test_a_failure_of_the_solver_is_taken_as_a_real_one(nycc):
    for kind in ("python", "c"):
        run = simulate(
            nycc,
            faults=[{"kind": "solver-failure", "at_s": AT_S, "for_s": 2}],
            settings={"mh_qp.implementation": kind},
        )
        assert run.trajectory.flags.nonzero()[0].tolist() == [AT_S, AT_S + 1]
        assert run.trajectory.fallback[AT_S : AT_S + 2] == ["shifted plan"] * 2
        assert run.summary()["flags"] == {"solver failed": 2}


@pytest.mark.slow
def test_after_the_run_the_controller_is_as_before(nycc):
    made = RecedingHorizon(nycc, QpPlanner(nycc))
    before = drive(nycc, made)
    for kind in ("wild", "solver-failure"):
        made.reset()
        faulted = drive(nycc, made, faults=as_faults([{"kind": kind, "at_s": 590, "for_s": 8}]))
        assert faulted.trajectory.flags[-1]  # the last second too: nothing ends the fault but us
    made.reset()
    after = drive(nycc, made)
    assert after.trajectory.soc.tolist() == before.trajectory.soc.tolist()


def test_a_user_s_planner_that_knows_of_no_injection_fails_too(nycc):
    class Steady(Planner):
        def plan(self, seen):
            return Plan(np.ones(5), np.full(5, 5e3))

    fault = {"kind": "solver-failure", "at_s": AT_S, "for_s": 1}
    run = simulate(nycc, Steady, faults=[fault])
    assert run.trajectory.flags[AT_S] == Flag.SOLVER_FAILED
    assert run.trajectory.fallback[AT_S] == "shifted plan"


def test_what_cannot_reach_a_controller_is_said(nycc):
    faults = [
        {"kind": "stale", "at_s": 5},
        {"kind": "solver-failure", "at_s": 9},
        {"kind": "nan", "signal": "soc", "at_s": 20},
    ]
    run = simulate(nycc, "ecms", faults=faults)
    assert [r for r in run.remarks if "no effect" in r] == [
        "ecms: no effect of stale: it has no preview that faults can be injected into",
        "ecms: no effect of solver-failure: it has no solver that can fail",
    ]
    assert [each["fuel_g"] for each in run.faults["each"][:2]] == [0.0, 0.0]
    assert run.summary()["flags"] == {"bad measurement": 1}


def test_a_fault_after_the_arrival_is_refused(nycc):
    with pytest.raises(InputError, match="fault 1: at_s must be below 598"):
        simulate(nycc, "ecms", faults=[{"kind": "stale", "at_s": 598}])


def test_decisions_of_a_missed_first_second(nycc):
    made = Watch(nycc)
    seen: list[Decision] = []
    drive(
        nycc,
        made,
        faults=as_faults([{"kind": "missed-second", "at_s": 0}]),
        on_step=lambda _, decision: seen.append(decision),
    )
    assert seen[0].command == Command(False, 0.0)  # there is no last one
