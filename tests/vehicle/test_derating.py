"""A battery that is weaker in the cold: its limits, and that all who use them keep them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain import plain_car

from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import MhQpSettings, RuleBasedSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.pwa.model import PwaModel, battery_samples
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import Command, Plant, PlantState
from qpmpc.vehicle.belief import Belief
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import optimal_line
from qpmpc.verification.bounds.lower_bound import lower_bound
from qpmpc.verification.bounds.relaxed_trip import relaxed_trip
from qpmpc.verification.independent.equations import Equations
from qpmpc.verification.nonlinear.mh_nlp import MhNlp

RATED = plain_car().with_settings({"thermal.t_amb_degc": -20.0})
COLD = RATED.with_settings({"battery.derating_share_per_k": 0.02})  # 40 % are left
# the same limits, as rated ones
RATED_SO = RATED.with_settings(
    {
        "battery.power_discharge_max_w": COLD.battery_discharge_max_w,
        "battery.power_charge_max_w": COLD.battery_charge_max_w,
    }
)
FREE = {"engine.start_fuel_g": 0.0}  # starts that cost something take the slow ones longer
# accelerates and brakes so hard that a battery of 40 % is at both limits, of 100 % beyond them
HARD = Cycle.from_samples(
    "hard", [0, 8, 20, 26, 34, 48, 56, 64, 80], [0, 14, 16, 0, 0, 22, 22, 4, 0]
)
ROUNDING_W = 1e-6
CONTROLLERS = {
    "rule-based": {},
    "ecms": {},
    "mh-costate": {},
    "mh-qp": {"mh_qp.implementation": "python"},
    "mh-qp-paper": {"mh_qp_paper.implementation": "python"},
    "baseline-mpc": {},
    "dp": {"dp.grid": "quick"},
}


@pytest.fixture(scope="module")
def runs():
    trip = Trip(HARD, COLD)
    return {name: simulate(trip, name, settings=own) for name, own in CONTROLLERS.items()}


@given(share=st.floats(0.0, 0.014), t_amb_degc=st.floats(-50.0, 50.0))
def test_limits_are_rated_ones_times_a_share_that_falls_below_10_degc(share, t_amb_degc):
    car = RATED.with_settings(
        {"battery.derating_share_per_k": share, "thermal.t_amb_degc": t_amb_degc}
    )
    left = min(1.0, 1.0 - share * (10.0 - t_amb_degc))
    second = Equations(car)
    for limit_w, rated_w, theirs_w in (
        (car.battery_discharge_max_w, 27e3, second.discharge_max_w),
        (car.battery_charge_max_w, 25e3, second.charge_max_w),
    ):
        assert limit_w == pytest.approx(left * rated_w, rel=1e-12)
        assert limit_w == pytest.approx(theirs_w, rel=1e-12)
        if share == 0.0 or t_amb_degc >= 10.0:
            assert limit_w == theirs_w == rated_w  # to the bit


def test_rated_limits_stay_as_given_and_nothing_is_derated_twice():
    assert (COLD.battery_discharge_max_w, COLD.battery_charge_max_w) == pytest.approx(
        (10.8e3, 10e3)
    )
    again = COLD.with_settings({"battery.aux_power_w": 400.0, "thermal.t_amb_degc": -20.0})
    assert again == COLD
    assert (again.battery.power_discharge_max_w, again.battery.power_charge_max_w) == (27e3, 25e3)
    other = COLD.with_settings({"battery.power_discharge_max_w": 20e3})
    assert other.battery_discharge_max_w == pytest.approx(8e3)
    assert COLD.with_settings({"thermal.t_amb_degc": 10.0}).battery_charge_max_w == 25e3


def test_too_little_left_is_refused_naming_both_keys():
    with pytest.raises(InputError) as caught:
        COLD.with_settings({"thermal.t_amb_degc": -36.0})
    line = str(caught.value)
    assert "battery.derating_share_per_k = 0.02" in line
    assert "thermal.t_amb_degc = -36" in line
    assert "at least 0.1 of them must be left" in line


def test_a_start_may_take_half_of_what_the_cold_battery_gives():
    COLD.with_settings({"engine.start_energy_j": 5.3e3})
    with pytest.raises(InputError, match=r"at most 5400 J, 50% of .* gives at -20 degC"):
        COLD.with_settings({"engine.start_energy_j": 5.5e3})


def test_curves_are_of_the_ambient_whatever_was_fitted_before():
    """Both are kept by battery and limits: ambient temperature is no part of a battery."""
    for car, most_w in ((RATED, 27e3), (COLD, 10.8e3), (RATED, 27e3)):
        ends = PwaModel.of(car).battery.breakpoints[[0, -1]]
        np.testing.assert_allclose(ends, [-most_w / 1.08, most_w])
        np.testing.assert_allclose(battery_samples(car)[0][[0, -1]], ends)
    mild = COLD.with_settings({"thermal.t_amb_degc": 0.0})
    assert mild.battery == COLD.battery
    assert PwaModel.of(mild).battery.breakpoints[-1] == pytest.approx(21.6e3)


def test_inputs_are_checked_by_what_the_cold_battery_can_do():
    can, before = (Capability.of(car, optimal_line(car.engine)) for car in (COLD, RATED))
    assert can.net_max_w == pytest.approx(before.net_max_w - 16.2e3)
    assert can.net_min_w == pytest.approx(before.net_min_w + 15e3)
    assert can.soc_per_s < 0.4 * before.soc_per_s


def test_a_model_believes_in_its_own_cold():
    assert Belief(mass=1.1).of(COLD).battery_discharge_max_w == COLD.battery_discharge_max_w
    mild = COLD.with_settings({"thermal.t_amb_degc": 0.0})
    trip = Trip(HARD, COLD, model=mild)
    assert trip.vehicle.battery_charge_max_w == pytest.approx(10e3)
    assert trip.as_believed.vehicle.battery_charge_max_w == pytest.approx(20e3)
    assert trip.as_believed.plant.charge_limit_w(0.6) == pytest.approx(20e3)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_trip_keeps_the_limits_in_force(runs, name):
    p_bat_w = runs[name].trajectory.p_bat_w
    assert p_bat_w.max() <= 10.8e3 + ROUNDING_W
    assert p_bat_w.min() == pytest.approx(-10e3, abs=ROUNDING_W)  # braking is at the limit
    assert not any(runs[name].summary()["violations"].values())
    assert runs[name].summary()["fallback_steps"] == 0


def test_without_derating_the_trip_goes_beyond_them():
    p_bat_w = simulate(Trip(HARD, RATED), "rule-based").trajectory.p_bat_w
    assert p_bat_w.max() > 11e3
    assert p_bat_w.min() == pytest.approx(-25e3, abs=ROUNDING_W)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_all_drive_as_with_a_battery_rated_so(runs, name):
    """To the bit: no part of any controller looks at a limit that is not in force."""
    rated = simulate(Trip(HARD, RATED_SO), name, settings=CONTROLLERS[name]).trajectory
    for field in ("engine_on", "p_eng_w", "p_bat_w", "soc", "t_cl_degc", "certificate_g"):
        np.testing.assert_array_equal(
            getattr(runs[name].trajectory, field), getattr(rated, field), field
        )


def test_bounds_on_fuel_are_as_with_a_battery_rated_so(runs):
    cold, rated_so = COLD.with_settings(FREE), RATED_SO.with_settings(FREE)
    bound = lower_bound(HARD, cold)
    assert bound == lower_bound(HARD, rated_so)
    assert bound.fuel_g < runs["dp"].fuel_soc_balanced_g
    assert relaxed_trip(HARD, cold) == relaxed_trip(HARD, rated_so)


def test_the_nonlinear_program_is_as_with_a_battery_rated_so():
    """Its plan of a second in which the engine runs."""
    found = []
    for car in (COLD, RATED_SO):
        nlp = MhNlp(Trip(HARD, car.with_settings(FREE)))
        seen = nlp.trip.observation(20, PlantState(0.6, 50.0, True))
        found.append(nlp.solve(seen).x)
    np.testing.assert_array_equal(*found)


def test_generated_c_has_the_limits_in_force(runs):
    cold, rated = (
        values_of(car, MhQpSettings(), RuleBasedSettings(), blocks=5) for car in (COLD, RATED_SO)
    )
    assert cold.scalars == rated.scalars
    assert cold.scalars["battery_discharge_max_w"] == pytest.approx(10.8e3)
    for name, array in cold.arrays.items():
        np.testing.assert_array_equal(array, rated.arrays[name], name)


def test_c_drives_as_python(runs):
    own = {"mh_qp.implementation": "c"}
    c, python = simulate(Trip(HARD, COLD), "mh-qp", settings=own), runs["mh-qp"]
    assert c.implementation == "c"
    np.testing.assert_array_equal(c.trajectory.engine_on, python.trajectory.engine_on)
    np.testing.assert_allclose(c.trajectory.p_eng_w, python.trajectory.p_eng_w, atol=1e-3)
    np.testing.assert_allclose(c.trajectory.p_bat_w, python.trajectory.p_bat_w, atol=1e-3)


def test_a_weaker_battery_costs_fuel(runs):
    """Of the braking that it cannot take; still no controller is below the optimum."""
    rated = simulate(Trip(HARD, RATED), "dp", settings=CONTROLLERS["dp"])
    optimum_g = runs["dp"].fuel_soc_balanced_g
    assert optimum_g > 1.1 * rated.fuel_soc_balanced_g
    for name, run in runs.items():  # quick grid
        assert run.fuel_soc_balanced_g > 0.998 * optimum_g, name


def test_the_plant_counts_what_is_beyond_the_limit_in_force():
    plant = Plant(COLD)
    state = plant.initial_state()
    _, flows = plant.step(state, Command(False, 0.0), 12e3, 10.0)
    assert flows.power_excess_w == pytest.approx(12.4e3 - 10.8e3)
    _, flows = plant.step(state, Command(False, 0.0), -15e3, 10.0)
    assert flows.p_bat_w == pytest.approx(-10e3)
    assert flows.p_friction_w == pytest.approx(15e3 - 400.0 - 10e3)


def test_a_run_says_what_the_cold_leaves(runs):
    line = (
        "the battery's power limits are 40 % of the rated ones, 10.8 kW and 10 kW of charge: "
        "it is taken to be at -20 °C, as the air, for the whole trip"
    )
    assert line in runs["rule-based"].summary()["remarks"]
    assert not any("rated" in each for each in Trip(HARD, RATED).remarks)
