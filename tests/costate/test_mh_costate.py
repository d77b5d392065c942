"""The controller on the road: fuel, limits, starts, certificate, restarts, settings."""

import numpy as np
import pytest

from qpmpc import Cycle, Trip, load_cycle, load_vehicle, simulate
from qpmpc.closed_loop import drive
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.faults.models import as_faults
from qpmpc.registry import make_controller, split_settings

NO_VIOLATION = {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}


@pytest.fixture(scope="module")
def road() -> Cycle:
    """Four minutes of NYCC."""
    nycc = load_cycle("nycc")
    return Cycle.from_samples("part", np.arange(241.0), nycc.speed_mps[120:361])


@pytest.fixture(scope="module")
def short_road() -> Cycle:
    nycc = load_cycle("nycc")
    return Cycle.from_samples("minute", np.arange(81.0), nycc.speed_mps[120:201])


@pytest.fixture(scope="module", params=["paper-liion", "prius-nimh"])
def pair(request, road):
    quick = {"dp.grid": "quick"}
    return [
        simulate(road, name, request.param, settings=quick if name == "dp" else None)
        for name in ("mh-costate", "mh-qp", "dp")
    ]


def test_fuel_is_near_the_optimum_and_no_limit_is_exceeded(pair):
    """0.01 and 0.15 % above DP when this was written; `mh-qp` 0.03 and 0.11."""
    ours, qp, dp = pair
    assert ours.comparable
    assert ours.summary()["violations"] == NO_VIOLATION
    assert not any(ours.trajectory.fallback)
    above = ours.fuel_soc_balanced_g / dp.fuel_soc_balanced_g - 1.0
    assert above < 5e-3
    assert above < qp.fuel_soc_balanced_g / dp.fuel_soc_balanced_g - 1.0 + 1e-3
    assert ours.trajectory.started.sum() <= 1.2 * dp.trajectory.started.sum() + 1


def test_the_certificate_is_never_negative_and_mostly_small(pair):
    certificate_g = pair[0].trajectory.certificate_g
    assert (certificate_g > -1e-6).all()
    assert np.median(certificate_g) < 5e-3 * pair[0].fuel_g
    found = pair[0].summary()["certificate_g"]
    assert found == {"max": certificate_g.max(), "mean": pytest.approx(certificate_g.mean())}
    assert pair[2].summary()["certificate_g"] == {"max": None, "mean": None}


def test_the_search_does_not_stand_still_where_the_coolant_is_at_its_limit_for_long():
    """A mountain road with the coolant at its upper limit in most blocks.

    The walk over these limits was cut short, so the search did not move: 409 g in the median of a
    hundred seconds of five rounds; it is 4 g. (With the three of the default it is 11.)
    """
    car = load_vehicle("paper-nimh").with_settings(
        {"thermal.t_amb_degc": 5.7, "trip.soc_init": 0.77, "trip.t_cl_init_degc": 64.5}
    )
    trip = Trip("judge-121", car)
    settings = ControllerSettings().with_settings({"mh_costate.rounds": 5})
    controller, state = make_controller("mh-costate", trip, settings), trip.plant.initial_state()
    controller.begin(trip)
    found = []
    for step in range(100):  # of 20 the median is between 4 and 9 g, of 100 it is 4
        seen = trip.observation(step, state)
        decision = controller.decide(seen)
        found.append(decision.certificate_g)
        state, _ = trip.plant.step(state, decision.command, seen.demand_w, seen.speed_mps)
    assert np.median(found) < 2e-3 * 2500.0  # g, of the fuel of the trip


def test_the_search_goes_on_where_a_limit_was_that_the_plan_has_left():
    """A cold coolant near the arrival, after a stop at its lower limit.

    A block that had passed kept the multiplier of that limit, was aimed at, and no round rose:
    fuel at the optimum's price of SOC was 5.2 % above it, and is not above it now.
    """
    start = {"thermal.t_amb_degc": 6.02, "trip.soc_init": 0.582, "trip.t_cl_init_degc": 46.245}
    ours, dp = (
        simulate("random-7095-542s", name, "prius-nimh", settings=start | more)
        for name, more in (("mh-costate", {}), ("dp", {"dp.grid": "quick"}))
    )
    spare_soc = ours.trajectory.soc[-1] - dp.trajectory.soc[-1]
    assert ours.fuel_g - dp.soc_price_g * spare_soc < 1.01 * dp.fuel_g


def test_the_plan_at_departure_expects_what_comes(pair):
    assert abs(pair[0].fuel_off_expected_percent) < 3.0


def test_shortest_runs_are_kept(pair):
    engine = pair[0].vehicle.engine
    assert pair[0].summary()["engine_runs_below_min_on_s"] == 0
    assert pair[0].summary()["engine_on_s"]["min"] >= max(engine.min_on_s, 1)


def test_a_run_can_be_repeated_and_survives_a_restart(short_road):
    trip = Trip(short_road, "paper-nimh")
    made = make_controller("mh-costate", trip)
    first = drive(trip, made)
    made.reset()
    again = drive(trip, made)
    assert np.array_equal(first.trajectory.p_eng_w, again.trajectory.p_eng_w)
    made.reset()
    restart = as_faults([{"kind": "reset", "at_s": 30}])
    restarted = drive(trip, made, faults=restart)
    assert restarted.fuel_soc_balanced_g == pytest.approx(first.fuel_soc_balanced_g, rel=0.02)
    assert restarted.summary()["violations"] == NO_VIOLATION


def test_an_engine_given_by_a_line_that_is_not_convex(road):
    """A knee in its fuel, as of an engine that enriches: 9 to 14 kW is a poor place to run."""
    power = (0.0, 9e3, 14e3, 30e3, 71e3)
    fuel = (0.1, 0.62, 1.08, 2.0, 5.2)
    bare = dict.fromkeys(
        (
            "displacement_l",
            "indicated_efficiency",
            "friction_speed_rpm",
            "friction_kj_per_rev_l",
            "torque_speed_rpm",
            "torque_max_nm",
        )
    )
    line = {"line_power_w": power, "line_fuel_g_per_s": fuel}
    settings = {f"engine.{name}": value for name, value in (bare | line).items()}
    run = simulate(road, "mh-costate", "paper-nimh", settings=settings)
    powers = run.trajectory.p_eng_w[run.trajectory.engine_on]
    between = (powers > 10e3) & (powers < 13e3)
    assert between.mean() < 0.1
    assert run.comparable
    assert (run.trajectory.certificate_g > -1e-6).all()


def test_settings_by_name(road):
    settings = {"mh_costate.rounds": 2, "mh_costate.horizon.blocks": 3}
    _, chosen = split_settings(settings, ["mh-costate"])
    made = make_controller("mh-costate", Trip(road, "paper-nimh"), chosen)
    sizes = made.library.values.sizes
    assert (sizes.stages, made.library.values.iterations) == (20 + 9, 2)
    with pytest.raises(InputError, match="rounds"):
        split_settings({"mh_costate.rounds": 0}, ["mh-costate"])
    with pytest.raises(InputError, match="entry_share must be 0"):
        split_settings({"mh_costate.horizon.entry_share": 0.5}, ["mh-costate"])
    idle = simulate("nycc", "rule-based", settings={"mh_costate.rounds": 2}).remarks
    assert any("no effect on rule-based: mh_costate.rounds" in line for line in idle)


@pytest.mark.parametrize("vehicle", ["paper-nimh", "prius-liion"])
def test_the_certificate_of_mh_qp(short_road, vehicle):
    """Of 30 iterations, and of so many that the QP is solved: never negative, and smaller.

    Compared in the first seconds, in which the states are the same and rounding on and off costs
    little: later it costs more than what 30 iterations leave.
    """
    asked = {"mh_qp.certificate": True, "mh_qp.implementation": "python"}
    few = simulate(short_road, "mh-qp", vehicle, settings=asked)
    many = simulate(short_road, "mh-qp", vehicle, settings={**asked, "mh_qp.admm.iterations": 500})
    for run in (few, many):
        assert (run.trajectory.certificate_g > -1e-6).all()
    same = slice(1, 10)
    np.testing.assert_allclose(few.trajectory.soc[:10], many.trajectory.soc[:10], atol=1e-5)
    mean_g = [run.trajectory.certificate_g[same].mean() for run in (few, many)]
    assert mean_g[0] > 2.0 * mean_g[1]
    plain = simulate(short_road, "mh-qp", vehicle, settings={"mh_qp.implementation": "python"})
    assert np.array_equal(plain.trajectory.p_eng_w, few.trajectory.p_eng_w)


def test_a_certificate_that_cannot_be_had(short_road):
    asked = {"mh_qp.certificate": True}
    with pytest.raises(InputError, match="no certificate"):
        simulate(short_road, "mh-qp", settings={**asked, "mh_qp.implementation": "c"})
    for other in ({"mh_qp.qp.soc_penalty_g": 1e3}, {"mh_qp.learning": True}):
        more = {**other, "mh_qp.implementation": "python"}
        with pytest.raises(InputError, match="no meaning"):
            simulate(short_road, "mh-qp", settings={**asked, **more})
