"""Where heat makes a charge cheap: the price of SOC is right, and stays from second to second."""

import numpy as np
import pytest

from qpmpc import Trip, load_vehicle, simulate
from qpmpc.controllers.mh_costate import MhCostate
from qpmpc.costate.program import LEAST_WORTH, USUAL_CHARGE, ProgramBuilder, unit_g
from qpmpc.preview.stages import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.settings import LimitSettings

COLD = {"thermal.t_amb_degc": -9.065389, "trip.soc_init": 0.598668, "trip.t_cl_init_degc": 46.11028}
RIDES = {
    "thermal.t_amb_degc": -5.566082,
    "trip.soc_init": 0.779444,
    "trip.t_cl_init_degc": 43.303724,
}


def trip_of(cycle: str, vehicle: str, start: dict[str, float]) -> Trip:
    return Trip(cycle, load_vehicle(vehicle).with_settings(start))


@pytest.mark.parametrize(("vehicle", "price_g"), [("paper-liion", 70.0), ("paper-nimh", 137.4)])
def test_a_departure_in_the_cold_knows_what_a_charge_is_worth(vehicle, price_g) -> None:
    """Ten minutes at the lower coolant limit: dynamic programming's own price of SOC.

    Smoothed as on a usual trip, where a charge is worth twice that, it was 21 and 17 % too high.
    """
    trip = trip_of("random-9312-592s", vehicle, COLD)
    controller = MhCostate(trip)
    controller.depart(trip.observation(0, trip.plant.initial_state()))
    assert controller.last is not None
    assert controller.last.at.charge[0] == pytest.approx(price_g, rel=0.06)


def test_the_price_of_heat_is_kept_where_a_rounded_plan_ends_a_kelvin_off(monkeypatch) -> None:
    """Its multiplier was dropped then, and the price of SOC fell to 0 or doubled for a minute."""
    found, solve = [], MhCostate.solve

    def noted(self, seen):
        plan = solve(self, seen)
        found.append(float(plan.at.charge[0]))
        return plan

    monkeypatch.setattr(MhCostate, "solve", noted)
    python = {"mh_costate.implementation": "python"}
    simulate("random-9361-286s", "mh-costate", "paper-liion", settings=RIDES | python)
    under_way = np.array(found[5:-40])
    assert np.ptp(np.log(under_way)) < np.log(1.3)


def test_the_switch_is_smoothed_by_what_a_charge_is_worth() -> None:
    trip = trip_of("nycc", "paper-nimh", {})
    controller, seen = MhCostate(trip), trip.observation(0, trip.plant.initial_state())
    stages: Stages = controller.preview.at(0)
    count = len(stages.duration_s)
    model = PwaModel.of(trip.vehicle)
    layout = trip.vehicle, model, count, LimitSettings(), controller.preview.settings
    about = Linearisation.constant(count, seen.t_cl_degc)
    usual_g = USUAL_CHARGE * unit_g(model)

    def width(share: float | None) -> np.ndarray:
        charge_g = None if share is None else np.full(count, share * usual_g)
        builder = ProgramBuilder(*layout)
        return builder.at(stages, seen.soc, seen.t_cl_degc, about, False, charge_g).width

    usual, drives = width(None), stages.duration_s > 0.0
    np.testing.assert_array_equal(width(1.0), usual)
    np.testing.assert_array_equal(width(3.0), usual)
    np.testing.assert_allclose(width(0.4)[drives], 0.4 * usual[drives])
    np.testing.assert_allclose(width(0.0)[drives], LEAST_WORTH * usual[drives])
