"""Another SOC at arrival than at departure: controllers aim at it, and fuel is priced by it."""

import numpy as np
import pytest
from plain import plain_car

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.results import COMPARABLE_SHARE
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.verification.bounds.lower_bound import lower_bound
from qpmpc.verification.dynamic_programming import DpSettings, solve_dp

EMPTIER = {"trip.soc_init": 0.6, "trip.soc_end": 0.5}
FULLER = {"trip.soc_init": 0.55, "trip.soc_end": 0.65}
QUICK = {"dp.grid": "quick"}


def car(name: str = "prius-liion", **more: object) -> Vehicle:
    return load_vehicle(name).with_settings({k.replace("__", "."): v for k, v in more.items()})


@pytest.fixture(scope="module")
def short() -> Cycle:
    """The first five minutes of the truncated NEDC."""
    cycle = load_cycle("nedc-truncated")
    part = slice(301)
    return Cycle("nedc-300", cycle.time_s[part], cycle.speed_mps[part], cycle.grade[part])


@pytest.mark.parametrize("asked", [EMPTIER, FULLER], ids=["emptier", "fuller"])
@pytest.mark.parametrize("controller", ["rule-based", "ecms", "mh-qp", "mh-qp-paper", "dp"])
def test_it_arrives_as_asked(short, controller, asked):
    """Of a change by 0.1; what is missing is what the controller leaves of this small battery also
    where no other SOC is asked for: ECMS has no preview, the iterations stop early.
    """
    allowed = {"dp": 0.0005, "ecms": 0.04}.get(controller, 0.02)
    settings = QUICK if controller == "dp" else {}
    trip = Trip(short, load_vehicle("prius-liion").with_settings(asked))
    run = simulate(trip, controller, settings=settings)
    end = float(run.trajectory.soc[-1])
    assert end == pytest.approx(asked["trip.soc_end"], abs=allowed)


def test_less_charge_at_arrival_costs_less_fuel_by_what_it_is_worth(short):
    """The optimum falls by the price of energy, which lies between those of the engine's best
    and worst: 0.25 to 0.5 of the heating value."""
    fuel = {}
    for soc_end in (0.5, 0.6):
        trip = Trip(short, car(trip__soc_end=soc_end))
        fuel[soc_end] = simulate(trip, "dp", settings=QUICK).fuel_g
    vehicle = car()
    spent_j = BatteryMaps(vehicle.battery).energy_between_j(0.5, 0.6)
    efficiency = spent_j / ((fuel[0.6] - fuel[0.5]) * vehicle.engine.lhv_j_per_kg * 1e-3)
    assert 0.25 < efficiency < 0.5


@pytest.mark.parametrize("asked", [EMPTIER, FULLER], ids=["emptier", "fuller"])
def test_near_the_optimum(short, asked):
    trip = Trip(short, plain_car("paper-liion").with_settings(asked))
    optimum = simulate(trip, "dp", settings=QUICK)
    run = simulate(trip, "mh-qp")
    # measured 0.7 and 0.2 %: the first is a start more than the optimum's three, 0.2 g of 51 and
    # what it burns at standstill; a second start too many would be 1.2 %
    assert run.fuel_soc_balanced_g < 1.008 * optimum.fuel_soc_balanced_g


@pytest.mark.slow
def test_the_proven_bound_knows_what_the_battery_is_to_give(short):
    trip = Trip(short, load_vehicle("prius-liion").with_settings(EMPTIER))
    bound = lower_bound(trip.cycle, trip.vehicle)
    optimum = simulate(trip, "dp", settings=QUICK)
    assert 0.95 * optimum.fuel_g < bound.fuel_g <= optimum.fuel_g


def test_c_and_python_plan_the_same_way_to_another_soc(short):
    """The command of each second differs by the solver's tolerance at most."""
    vehicle = car("prius-prime", trip__soc_init=0.4, trip__soc_end=0.37)
    runs = [
        simulate(
            Trip(short, vehicle),
            "mh-qp",
            settings={"mh_qp.implementation": how},
        )
        for how in ("c", "python")
    ]
    a, b = (run.trajectory for run in runs)
    assert np.array_equal(a.engine_on, b.engine_on)
    assert np.abs(a.p_eng_w - b.p_eng_w).max() < 1.0


def test_a_surplus_is_worth_something_unless_the_target_is_a_least(short):
    """Of a plug-in that cannot empty its battery on so short a trip."""
    asked = {"trip.soc_init": 0.8, "trip.soc_end": 0.3}
    either, least = (
        simulate(
            Trip(short, car("prius-prime").with_settings({**asked, "trip.soc_end_at_least": flag})),
            "rule-based",
            settings={"rule_based.balance": False},
        )
        for flag in (False, True)
    )
    assert either.trajectory.soc[-1] > 0.7
    assert np.array_equal(either.trajectory.soc, least.trajectory.soc)
    assert either.fuel_soc_balanced_g < 0.0 < least.fuel_soc_balanced_g == least.fuel_g
    assert not either.comparable
    assert least.comparable


def test_a_deficit_always_costs(short):
    """The rules, off their reference by 0.02, end below a target that is a least."""
    vehicle = car(trip__soc_end=0.6, trip__soc_end_at_least=True)
    rules = {"rule_based.balance": False, "rule_based.soc_ref_offset": -0.1}
    run = simulate(Trip(short, vehicle), "rule-based", settings=rules)
    missing = 0.6 - float(run.trajectory.soc[-1])
    assert missing > 0.0
    price_g = BatteryMaps(vehicle.battery).energy_j(0.6) / (
        vehicle.trip.eta_eq * vehicle.engine.lhv_j_per_kg * 1e-3
    )
    assert run.soc_correction_g == pytest.approx(missing * price_g)


def test_the_json_tells_what_was_asked_and_what_the_battery_gave(short):
    vehicle = car("prius-prime", trip__soc_init=0.4)
    run = simulate(Trip(short, vehicle), "mh-qp")
    summary = run.summary()
    assert summary["soc_end_target"] == 0.25
    assert summary["soc_end_at_least"] is True
    # U_oc moves by 0.03 V in a second: the explicit step's sum and the integral differ by less
    drawn_kwh = run.trajectory.p_bat_w.sum() / 3.6e6
    assert 0.0 < drawn_kwh < summary["battery_used_kwh"] < 1.05 * drawn_kwh


def test_a_run_without_much_fuel_is_compared_by_what_the_battery_was_to_give(short):
    """A correction of a gram is much of no fuel, but little of the charge that was to be used."""
    vehicle = car("prius-prime", trip__soc_init=0.28, trip__soc_end_at_least=False)
    run = simulate(Trip(short, vehicle), "mh-qp")
    share = abs(run.soc_correction_g) / (run.fuel_g + run.depletion_g)
    assert run.comparable == (share <= COMPARABLE_SHARE)
    assert run.depletion_g > 20.0


def test_the_rules_are_forced_on_near_the_lower_limit_of_any_battery():
    rules = ControllerSettings().rule_based
    assert rules.forced_below(load_vehicle("prius-nimh").battery) == 0.45
    assert rules.forced_below(load_vehicle("prius-prime").battery) == 0.25
    given = rules.model_copy(update={"soc_forced": 0.5})
    assert given.forced_below(load_vehicle("prius-prime").battery) == 0.5


@pytest.mark.parametrize("soc_end", [0.39, 0.81])
def test_a_target_beyond_the_limits_is_refused(soc_end):
    with pytest.raises(InputError, match=r"trip\.soc_end must lie between battery\.soc_min"):
        car(trip__soc_end=soc_end)


def test_the_costate_at_departure_is_the_price_of_the_final_soc(short):
    """The optimum's slope over the SOC asked for, by central difference; NYCC: 0.1 to 0.4 % off."""
    quick = DpSettings.quick()
    best = solve_dp(short, car("paper-nimh"), quick)
    less, more = (
        solve_dp(short, car("paper-nimh", trip__soc_end=soc_end), quick).fuel_total_g
        for soc_end in (0.58, 0.62)
    )
    assert float(best.soc_costate_g[0]) == pytest.approx((more - less) / 0.04, rel=0.02)


def test_charge_that_the_trip_does_not_need_makes_it_no_dearer():
    """A plug-in that departs full burns for heat alone, as one that departs at 0.35.

    Its iterations once ended long before the price of charge was down to nothing: 29 g, not 22.
    """
    fuel = [
        simulate(Trip("nycc", car("prius-prime", trip__soc_init=soc)), "mh-qp").fuel_g
        for soc in (0.35, 0.9)
    ]
    assert fuel[1] < 1.02 * fuel[0]
