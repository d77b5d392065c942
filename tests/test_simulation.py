"""Simulation by names and objects: everything that can drive a cycle, and settings of it."""

import json
import logging
import subprocess
import sys

import numpy as np
import pytest

from qpmpc import Command, Controller, remarks
from qpmpc.codegen.c_compiler import compiler
from qpmpc.comparison import compare
from qpmpc.controllers.ecms import Ecms
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.rule_based import RuleBased
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError, QpmpcError
from qpmpc.registry import (
    CONTROLLERS,
    PLANNERS,
    check_controllers,
    controller_names,
    make_controller,
    split_settings,
    without_effect,
)
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp


@pytest.fixture
def trip() -> Cycle:
    speed = [0.0, 3.0, 6.0, 9.0, 12.0, 14.0, 14.0, 14.0, 14.0, 12.0, 8.0, 4.0, 0.0]
    return Cycle.from_samples("trip", 2.0 * np.arange(len(speed)), speed)


def test_every_controller_can_be_run_and_the_default_is_first():
    assert controller_names()[0] == "mh-qp"
    assert set(controller_names()) == {*CONTROLLERS.names(), *PLANNERS.names()}
    assert "dp" in controller_names()
    check_controllers(controller_names())


def test_unknown_name(trip):
    with pytest.raises(InputError, match=r"'pid'.*mh-qp.*dp"):
        simulate(trip, "pid", load_vehicle())


def test_progress_reaches_the_end(trip):
    seen: list[tuple[int, int]] = []
    simulate(trip, "rule-based", load_vehicle(), progress=lambda *done: seen.append(done))
    assert seen[-1] == (trip.steps, trip.steps)


def test_plan_of_dynamic_programming_is_replayed_exactly(trip, tmp_path, monkeypatch):
    """The same plant is under both, so state and fuel agree to rounding."""
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    vehicle, coarse = load_vehicle(), DpSettings(soc_step=0.01, power_step_w=2000.0)
    plan = solve_dp(trip, vehicle, coarse)
    settings = ControllerSettings().with_section("dp", coarse)
    replayed = simulate(trip, "dp", vehicle, settings=settings)
    assert replayed.controller == "dp"
    np.testing.assert_allclose(replayed.trajectory.soc, plan.soc, atol=1e-9)
    np.testing.assert_allclose(replayed.trajectory.t_cl_degc, plan.t_cl_degc, atol=1e-6)
    assert replayed.fuel_g == pytest.approx(plan.fuel_total_g, rel=1e-9)
    assert np.isnan(replayed.trajectory.step_time_s).all()


# settings


def test_settings_of_vehicle_and_controller_in_one_call(trip):
    both = {"thermal.t_amb_degc": -15, "trip.soc_init": 0.55, "mh_qp.admm.iterations": 7}
    run = simulate(trip, "mh-qp", settings=both)
    assert run.vehicle.thermal.t_amb_degc == -15.0
    assert run.trajectory.soc[0] == 0.55
    assert set(run.trajectory.iterations) == {7}
    cold = load_vehicle().with_settings({"thermal.t_amb_degc": -15, "trip.soc_init": 0.55})
    of_mh_qp = ControllerSettings().with_settings({"mh_qp.admm.iterations": 7})
    apart = simulate(trip, "mh-qp", cold, settings=of_mh_qp)
    np.testing.assert_array_equal(run.trajectory.soc, apart.trajectory.soc)
    assert run.vehicle == apart.vehicle


def test_settings_of_the_vehicle_leave_a_trip_its_forecast(trip):
    shorter = Cycle.from_samples("shorter", trip.time_s[:15], trip.speed_mps[:15])
    warm = {"thermal.t_amb_degc": 10.0}
    run = simulate(Trip(trip, forecast=shorter), "mh-qp", settings=warm)
    car = load_vehicle().with_settings(warm)
    same = simulate(Trip(trip, car, Trip(shorter).truth), "mh-qp")
    np.testing.assert_array_equal(run.trajectory.p_eng_w, same.trajectory.p_eng_w)


def test_settings_that_come_too_late_are_refused(trip):
    """A controller that is made already would not see them."""
    road = Trip(trip)
    late = {"ecms.factor": 3.0}
    for made in (RuleBased(road), MhQp(road), MhQp(road).planner):
        for settings in (late, ControllerSettings().with_settings(late)):
            with pytest.raises(InputError, match="made already"):
                simulate(road, made, settings=settings)
        simulate(road, made, settings=ControllerSettings())
    with pytest.raises(InputError, match="made already: make it, and its trip, with them"):
        simulate(road, RuleBased(road), settings={"thermal.t_amb_degc": -15.0})
    runs = compare(road, [RuleBased(road), Ecms], settings=late)  # there they reach one of two
    assert [run.controller for run in runs] == ["rule-based", "ecms"]


@pytest.mark.parametrize(
    ("old", "value", "new"),
    [
        ("mh_qp.osqp.iterations", 25, "mh_qp.admm.iterations"),
        ("mh_qp.osqp.sigma", 1e-6, "mh_qp.admm.proximal_weight"),
        ("mh_qp_paper.osqp.rho", 0.1, "mh_qp_paper.admm.rho"),
        ("baseline_mpc.osqp.cold_iterations", 100, "baseline_mpc.admm.cold_iterations"),
        ("mh_qp.solver", "generated", "mh_qp.implementation=c"),
        ("mh_qp.solver", "auto", "mh_qp.implementation=auto"),
    ],
)
def test_old_names_are_one_line_with_the_new_one(trip, old, value, new):
    for use in (
        lambda: split_settings({old: value}),
        lambda: ControllerSettings().with_settings({old: value}),
        lambda: simulate(trip, "mh-qp", settings={old: value}),
    ):
        with pytest.raises(InputError) as refusal:
            use()
        line = str(refusal.value)
        assert line.startswith(old)
        assert line.endswith(f"is now called {new}")
        assert "\n" not in line


# C or Python

BEYOND_C = [
    ({"mh_qp.solver": "piqp"}, "mh_qp.solver=piqp"),
    ({"mh_qp.admm.status_tolerance": 1e-5}, "mh_qp.admm.status_tolerance"),
]


@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(("chosen", "named"), BEYOND_C)
def test_what_generated_c_cannot_do_is_refused_where_c_is_asked_for(trip, chosen, named):
    with pytest.raises(InputError) as refusal:
        simulate(trip, "mh-qp", settings={**chosen, "mh_qp.implementation": "c"})
    assert named in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(("chosen", "named"), BEYOND_C)
def test_auto_falls_back_to_python_and_says_so(trip, caplog, chosen, named):
    remarks.say_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        run = simulate(trip, "mh-qp", settings=chosen)
        of_the_battery, remark = run.remarks
        assert "rated" in of_the_battery
        assert "\n" not in remark
        assert "runs in Python, not in C" in remark
        assert named in remark
        assert [record.getMessage() for record in caplog.records] == [remark]
        assert caplog.records[0].name == "qpmpc"
        simulate(trip, "mh-qp", settings=chosen)
    assert len(caplog.records) == 1  # once per process
    summary = run.summary()
    assert summary["solver"]["implementation"] == "python"
    # and, on so short a trip, that its fuel cannot be compared
    others = [line for line in summary["remarks"] if "not comparable" not in line]
    assert others == [of_the_battery, remark]
    asked = simulate(trip, "mh-qp", settings={**chosen, "mh_qp.implementation": "python"})
    assert asked.remarks == (of_the_battery,)
    np.testing.assert_array_equal(asked.trajectory.p_eng_w, run.trajectory.p_eng_w)


def test_a_rival_with_settings_of_admm_is_refused(trip):
    for implementation_ in ("auto", "python"):
        chosen = {
            "mh_qp.solver": "piqp",
            "mh_qp.admm.iterations": 25,
            "mh_qp.implementation": implementation_,
        }
        with pytest.raises(InputError, match=r"mh_qp\.admm has no effect") as refusal:
            simulate(trip, "mh-qp", settings=chosen)
        assert "mh_qp.solver=piqp" in str(refusal.value)
        assert "\n" not in str(refusal.value)


def test_an_unknown_solver_is_refused_with_those_there_are(trip):
    with pytest.raises(InputError, match=r"'gurobi'.*osqp.*piqp"):
        simulate(trip, "mh-qp", settings={"mh_qp.solver": "gurobi"})


@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
def test_the_fallback_is_one_line_on_stderr(trip, tmp_path):
    file = tmp_path / "trip.csv"
    calm_mps = 0.8 * trip.speed_mps  # of which nothing else is said
    rows = zip(trip.time_s.tolist(), calm_mps.tolist(), strict=True)
    file.write_text("time_s,speed_mps\n" + "".join(f"{t},{v}\n" for t, v in rows))
    command = [sys.executable, "-m", "qpmpc", "simulate", file, "--set", "mh_qp.solver=piqp"]
    done = subprocess.run(
        [*command, "--json", tmp_path / "run.json"], capture_output=True, text=True, check=True
    )
    (line,) = done.stderr.splitlines()
    assert "runs in Python, not in C" in line
    assert json.loads((tmp_path / "run.json").read_text())["remarks"][1:] == [line]


def test_piqp_named_by_settings_drives_as_the_backend_given(trip):
    road = Trip(trip)
    chosen = {"mh_qp.implementation": "python", "mh_qp.solver": "piqp"}
    by_name = simulate(road, "mh-qp", settings=chosen)
    by_argument = simulate(road, MhQp(road, solver="piqp"))
    assert by_name.solver == by_argument.solver == "piqp"
    np.testing.assert_array_equal(by_name.trajectory.p_eng_w, by_argument.trajectory.p_eng_w)
    made = make_controller("mh-qp", road, ControllerSettings().with_settings(chosen))
    assert (made.implementation, made.solver_name) == ("python", "piqp")


def test_two_of_one_name_and_a_shipped_name_are_refused(trip):
    class Own(Controller):
        def step(self, seen):
            return Command(False, 0.0)

    class RuleBased(Own):
        pass

    for twice in ([Own, Own], ["mh-qp", "mh-qp"]):
        with pytest.raises(InputError, match="is named twice"):
            compare(trip, twice)
    with pytest.raises(InputError, match="'rule-based': this name is that of a shipped one"):
        simulate(trip, RuleBased)


def test_one_comparison_has_one_vehicle(trip):
    cars = [Trip("nycc", "prius-nimh"), Trip("udds", "prius-liion")]
    with pytest.raises(InputError, match=r"not several \(prius-nimh, prius-liion\)"):
        compare(cars, ["rule-based"])


@pytest.mark.parametrize(
    ("settings", "idle"),
    [
        (
            {"mh_qp.horizon.classes": 1, "mh_qp.horizon.swing_share": 0.5},
            "mh_qp.horizon.swing_share",
        ),
        ({"mh_qp.horizon.block_s": 60}, "mh_qp.horizon.block_s"),
        (
            {"mh_qp.horizon.blocks": 0, "mh_qp.horizon.block_s": 0, "mh_qp.horizon.classes": 1},
            "mh_qp.horizon.classes",
        ),
        ({"mh_qp.solver": "piqp", "mh_qp.admm.iterations": 20}, "mh_qp.admm.iterations"),
        ({"mh_qp.horizon.blocks": 0, "mh_qp.horizon.block_s": 60}, ""),
    ],
)
def test_settings_without_effect_beside_others_are_named(settings, idle):
    assert without_effect(settings, ["mh-qp"]) == (f"no effect on mh-qp: {idle}" if idle else "")


def test_settings_without_effect_are_said(trip, caplog):
    run = simulate(trip, "rule-based", settings={"mh_qp.admm.iterations": 25, "ecms.factor": 3.0})
    line = "no effect on rule-based: ecms.factor, mh_qp.admm.iterations"
    assert run.summary()["remarks"][1:] == [line]
    assert caplog.messages == [line]
    of_nlp = {"mh_qp.qp.t_cl_margin_k": 1.0, "mh_qp.admm.iterations": 25}
    assert simulate(trip, "mh-nlp", settings=of_nlp).summary()["remarks"][1:] == [
        "no effect on mh-nlp: mh_qp.admm.iterations"
    ]
    quiet = simulate(trip, "rule-based", settings={"rule_based.on_w": 7e3})
    assert quiet.summary()["remarks"][1:] == []


def test_what_is_no_settings_is_one_line(trip):
    for wrong in ("mh_qp.admm.iterations=25", [1], 3):
        with pytest.raises(InputError, match="settings must be a dictionary of dotted names"):
            simulate(trip, settings=wrong)


def test_settings_by_dotted_name_make_a_controller_too(trip):
    made = MhQp(Trip(trip), {"mh_qp.admm.iterations": 25})
    assert made.settings.mh_qp.admm.iterations == 25


def test_settings_of_the_vehicle_reach_a_forecast_given_as_a_cycle(trip):
    """The demand of the forecast is that of the vehicle that drives."""
    shorter = Cycle.from_samples("shorter", trip.time_s[:15], trip.speed_mps[:15])
    heavy = {"chassis.mass_kg": 1800.0}
    run = simulate(Trip(trip, forecast=shorter), "mh-qp", settings=heavy)
    car = load_vehicle().with_settings(heavy)
    same = simulate(Trip(trip, car, shorter), "mh-qp")
    np.testing.assert_array_equal(run.trajectory.p_eng_w, same.trajectory.p_eng_w)
    np.testing.assert_array_equal(
        Trip(trip, forecast=shorter).with_vehicle(car).forecast.demand_w,
        Trip(shorter, car).truth.demand_w,
    )


def test_a_forecast_is_a_cycle_or_a_trace(trip):
    for wrong in ("nycc", Trip(trip), [1.0, 2.0]):
        with pytest.raises(InputError, match="the forecast must be a Cycle, or a Trace"):
            Trip(trip, forecast=wrong)


def test_settings_in_the_constructor_are_checked_as_elsewhere(trip):
    road = Trip(trip)
    for wrong in ("mhqp.admm.iterations", "thermal.t_amb_degc", "dp.soc_points"):
        for kind in (MhQp, RuleBased, Ecms):
            with pytest.raises(
                InputError, match=rf"no settings {wrong.partition('.')[0]}[:,].* here"
            ):
                kind(road, {wrong: 3})


@pytest.mark.parametrize("wrong", [5, None, {}, lambda trip, settings: None, RecedingHorizon, int])
def test_what_is_no_controller_is_one_line(trip, wrong):
    for use in (lambda: simulate(trip, wrong), lambda: compare(trip, ["rule-based", wrong])):
        with pytest.raises(InputError, match="controller"):
            use()


def test_an_abstract_controller_is_one_line_with_what_it_lacks(trip):
    class Half(Controller):
        pass

    with pytest.raises(InputError, match="controller 'Half' lacks step"):
        simulate(trip, Half)


def test_a_controller_that_cannot_drive_is_refused_before_any_run(trip):
    road, told = Trip(trip), []
    driven = RuleBased(road)
    simulate(road, driven)
    with pytest.raises(QpmpcError, match="has driven already"):
        compare(road, ["mh-qp", driven], next_job=told.append)
    with pytest.raises(InputError, match="'rule-based' is made for one trip: give its class"):
        compare([road, "nycc"], [RuleBased(road)], next_job=told.append)
    assert told == []


def test_idle_settings_are_said_in_every_run(trip):
    runs = compare([trip, "nycc"], "rule-based", settings={"ecms.factor": 3.0})
    line = "no effect on rule-based: ecms.factor"
    assert [run.remarks[1:] for run in runs] == [(line,)] * 2


def test_a_backend_given_by_name_is_that_of_the_settings(trip):
    """The settings of ADMM apply to OSQP, and are refused with another backend."""
    few = {"mh_qp.admm.iterations": 7}
    run = simulate(Trip(trip), MhQp(Trip(trip), few, solver="osqp"))
    assert set(run.trajectory.iterations) == {7}
    for iterations in (7, 50):  # 50: the default elsewhere, not here
        with pytest.raises(InputError, match=r"mh_qp\.admm has no effect with mh_qp\.solver=piqp"):
            MhQp(Trip(trip), {"mh_qp.admm.iterations": iterations}, solver="piqp")
    in_c = MhQp(Trip(trip), {"mh_qp.implementation": "c"})
    assert in_c.remarks == ["mh_qp.implementation=c has no effect here: MhQp is in Python"]


@pytest.mark.parametrize("band", [(0.1, 0.2), (0.3, 0.5)])
@pytest.mark.parametrize("implementation", ["c", "python"])
def test_an_empty_terminal_band_is_one_line(trip, band, implementation):
    settings = dict(zip(("mh_qp.qp.terminal_low", "mh_qp.qp.terminal_high"), band, strict=True))
    settings["mh_qp.implementation"] = implementation
    with pytest.raises(InputError, match=r"leave no terminal SOC: 0\.\d+ is above 0\.\d+"):
        simulate(trip, settings=settings)


def test_a_solver_that_is_no_name_is_refused(trip):
    with pytest.raises(InputError, match=r"mh_qp\.solver"):
        simulate(trip, settings={"mh_qp.solver": ["osqp"]})


def test_a_subclass_runs_under_its_own_name(trip):
    class Warmer(MhQp):
        pass

    class Named(MhQp):
        name = "named"

    runs = compare(trip, [MhQp, Warmer, Named])
    assert [run.controller for run in runs] == ["mh-qp", "warmer", "named"]


def test_refusals_name_the_section_that_was_set(trip):
    for section in ("mh_qp", "mh_qp_paper"):
        chosen = {f"{section}.implementation": "c", f"{section}.solver": "osqp"}
        with pytest.raises(InputError, match=f"not {section}.solver=osqp"):
            simulate(trip, section.replace("_", "-"), settings=chosen)
