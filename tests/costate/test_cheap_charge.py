"""Where heat makes a charge cheap: the price of SOC is right, and stays from second to second."""

import numpy as np
import pytest

from qpmpc import Trip, load_vehicle, simulate
from qpmpc.controllers.mh_costate import MhCostate
from qpmpc.costate.dual import Multipliers, StageCosts, smoothed
from qpmpc.costate.program import LEAST_WORTH, moderate
from qpmpc.preview.stages import Stages
from qpmpc.qp.linearisation import Linearisation

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

    Smoothed as on a usual trip, where a charge is worth twice that and the engine gives power while
    it runs, it was 21 and 17 % too high.
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


def test_the_switch_is_smoothed_by_what_the_engines_power_is_worth() -> None:
    """By lambda E against that of a usual trip and a moderate power, between a tenth and all."""
    trip = trip_of("nycc", "paper-nimh", {})
    controller, seen = MhCostate(trip), trip.observation(0, trip.plant.initial_state())
    stages: Stages = controller.preview.at(0)
    count = len(stages.duration_s)
    about = Linearisation.constant(count, seen.t_cl_degc)
    program = controller.programs.at(stages, seen.soc, seen.t_cl_degc, about, False)
    drives = stages.duration_s > 0.0

    def parts(charge_share: float, heat_g_per_k: float) -> tuple[np.ndarray, np.ndarray]:
        """W over the most that it is, and the power at these prices, of the stages."""
        heat = np.zeros(count)
        heat[-1] = heat_g_per_k
        at = Multipliers(np.full(count, charge_share * program.usual_charge_g), heat)
        power_w = StageCosts.of(program, at, program.shared).on.power_w
        return (smoothed(program, at).width / program.widest)[drives], power_w[drives]

    moderate_w, _ = moderate(program.curves)
    for charge_share, heat in ((1.0, 0.0), (3.0, 0.0), (0.5, 0.0), (0.5, 3.0), (0.2, 0.0)):
        part, power_w = parts(charge_share, heat)
        expected = np.clip(charge_share * power_w / moderate_w, LEAST_WORTH, 1.0)
        np.testing.assert_allclose(part, expected)
    # the cases tell: all of it on a usual trip in some stage, and a tenth where the engine idles
    assert parts(1.0, 0.0)[0].max() == 1.0
    idles = parts(0.2, 0.0)[1] < 1.0
    assert idles.any()
    np.testing.assert_allclose(parts(0.2, 0.0)[0][idles], LEAST_WORTH)
