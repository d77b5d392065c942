"""A model that differs from the plant: what each factor does, and who believes it."""

import numpy as np
import pytest

from qpmpc.controllers.base import Controller
from qpmpc.controllers.rule_based import RuleBased
from qpmpc.errors import InputError, QpmpcError
from qpmpc.registry import make_controller, reads, without_effect
from qpmpc.simulation import prepared, simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.belief import Belief, with_settings
from qpmpc.vehicle.engine import optimal_line

VEHICLE = load_vehicle()


def test_factors_of_one_change_nothing() -> None:
    assert Belief().of(VEHICLE) == VEHICLE
    assert Trip("nycc", VEHICLE, model=VEHICLE).as_believed.vehicle == VEHICLE


@pytest.mark.parametrize(
    ("belief", "section", "names"),
    [
        (Belief(mass=1.1), "chassis", ("mass_kg",)),
        (Belief(eta_drive=1.1), "chassis", ("eta_drive",)),
        (Belief(resistance=1.1), "battery", ("resistance_discharge_ohm", "resistance_charge_ohm")),
        (Belief(capacity=1.1), "battery", ("capacity_ah",)),
        (Belief(heat_capacity=1.1), "thermal", ("heat_capacity_j_per_k",)),
        (Belief(ua=1.1), "thermal", ("ua0_w_per_k", "ua1_w_per_k_per_mps")),
    ],
)
def test_a_factor_is_on_its_own_parameters_and_no_other(belief, section, names) -> None:
    model = belief.of(VEHICLE)
    for name in names:
        value = np.asarray(getattr(getattr(model, section), name))
        np.testing.assert_allclose(value / getattr(getattr(VEHICLE, section), name), 1.1)
    parts = {f"{section}.{name}": getattr(getattr(VEHICLE, section), name) for name in names}
    assert model.with_settings(parts) == VEHICLE


def test_fuel_is_wrong_by_level_tilt_and_idle() -> None:
    line = optimal_line(VEHICLE.engine)
    share = line.power_w / line.power_max_w
    wrong = Belief(fuel_level=1.2, fuel_tilt=-0.1, fuel_idle=1.5).of(VEHICLE)
    expected = line.fuel_g_per_s + 0.5 * line.fuel_g_per_s[0]
    expected = 1.2 * expected * (1.0 - 0.1 * (2.0 * share - 1.0))
    np.testing.assert_allclose(optimal_line(wrong.engine).fuel_g_per_s, expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"model.mas": 1.1}, "model: no parameter 'mas'"),
        ({"model.mass": 1500.0}, "model: mass: must be less than or equal to 2"),
        ({"model.eta_drive": 1.5}, "the model of vehicle prius-nimh: chassis.eta_drive"),
        ({"model": 1.1}, "model"),
    ],
)
def test_what_cannot_be_believed_is_said_in_a_line(settings, message) -> None:
    with pytest.raises(InputError, match=message) as caught:
        prepared(Trip("nycc"), settings, ["mh-qp"])
    assert "\n" not in str(caught.value)


def test_settings_of_the_vehicle_apply_to_a_model_too_and_twice_is_once() -> None:
    settings: dict[str, object] = {"thermal.t_amb_degc": -15.0, "model.mass": 1.1}
    vehicle, model = with_settings(VEHICLE, None, settings)
    assert model is not None
    assert model.thermal.t_amb_degc == vehicle.thermal.t_amb_degc == -15.0
    assert with_settings(vehicle, model, settings) == (vehicle, model)
    assert with_settings(vehicle, model, {"thermal.t_amb_degc": 0.0})[1].chassis == model.chassis


def test_controllers_believe_the_model_and_the_plant_stays() -> None:
    trip = Trip("nycc", VEHICLE).with_settings({"model.mass": 1.2, "model.fuel_tilt": 0.1})
    made: Controller = make_controller("rule-based", trip)
    assert made.trip.vehicle.chassis.mass_kg == pytest.approx(1.2 * VEHICLE.chassis.mass_kg)
    assert trip.vehicle == VEHICLE
    assert trip.start.demand_w == Trip("nycc", VEHICLE).start.demand_w
    with pytest.raises(QpmpcError, match="was made for"):
        RuleBased(Trip("nycc", VEHICLE)).begin(trip)


def test_the_optimum_knows_the_plant() -> None:
    trip = Trip("nycc", VEHICLE).with_settings({"model.mass": 1.2})
    assert make_controller("dp", trip).trip is trip
    assert not reads("dp", "model.mass")
    assert "model.mass" in without_effect({"model.mass": 1.2}, ["dp"])


def test_a_run_says_what_its_model_has_wrong() -> None:
    settings = {"model.mass": 1.2, "model.fuel_level": 1.1, "rule_based.balance": False}
    remarks = simulate("nycc", "rule-based", settings=settings).summary()["remarks"]
    assert remarks[1:2] == [
        "the model that all controllers but dp have is wrong: chassis.mass_kg 1.2 times; "
        "fuel 1.1, 1.1, 1.1 times at idle, half, full power"
    ]
