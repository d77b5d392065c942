"""`mh-costate` has the rules of the coming second, each second at its own prices."""

import numpy as np
import pytest
from short_trip import assert_same_commands, drive_in

from qpmpc import Trip, load_vehicle
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.mh_costate import MhCostate
from qpmpc.costate.dual import coolant_costate
from qpmpc.trajectory import Trajectory

TRIP, CAR = "random-9499-122s", "prius-liion"  # two minutes near the lower SOC limit
START = {
    "thermal.t_amb_degc": -1.136553,
    "trip.soc_init": 0.434018,
    "trip.t_cl_init_degc": 77.780451,
}


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, TRIP, CAR, START, "mh-costate")


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_they_spare_a_start_in_c_as_in_python(monkeypatch) -> None:
    """Four starts before, and 1.2 % more fuel."""
    now, in_c = drive("python"), drive("c")
    monkeypatch.setattr(
        "qpmpc.controllers.mh_costate.least_w", lambda *of_plan: of_plan[-2]
    )  # that of the ramp
    before = drive("python")
    assert_same_commands(now, in_c)
    assert now.started.sum() == before.started.sum() - 1
    soc_g = 166.0  # of a unit of SOC with this battery
    fuel_g = [run.fuel_g.sum() - soc_g * (run.soc[-1] - run.soc[0]) for run in (now, before)]
    assert fuel_g[0] < 0.99 * fuel_g[1]
    assert now.soc.min() >= load_vehicle(CAR).battery.soc_min


def test_the_seconds_ahead_are_those_of_the_plan() -> None:
    """Their least-cost power, and what each costs more, at its own lambda and nu, than at rest."""
    trip = Trip("nycc", load_vehicle(CAR))
    controller, seen = MhCostate(trip), trip.observation(0, trip.plant.initial_state())
    controller.depart(seen)
    plan = controller.solve(seen)
    p, going, count = plan.program, plan.coming.going, plan.program.short
    nu = coolant_costate(p, plan.at.heat)[:count]
    store = plan.at.charge[:count] * p.charge_per_w[:count]
    fuel = p.fuel_cost[:count] - nu * p.per_fuel[:count]
    work = nu * p.per_power[:count]
    assert (plan.coming.fuel_g_per_g, plan.coming.store_g_per_j) == (fuel[0], store[0])

    def cost_g(power_w: np.ndarray, net_w: np.ndarray) -> np.ndarray:
        burnt = p.curves.fuel_g_per_s(power_w)
        return fuel * burnt + work * power_w + store * p.curves.internal_w(net_w - power_w)

    net_w, off_w = plan.stages.net_w[:count], plan.stages.internal_off_w[:count]
    on_w = p.curves.internal_w(net_w - going.power_w)
    np.testing.assert_allclose(going.gain_w, off_w - on_w, rtol=1e-9, atol=1e-9)
    dearer_g = cost_g(going.power_w, net_w) - store * off_w
    np.testing.assert_allclose(going.dearer_g_per_s, dearer_g, rtol=1e-9, atol=1e-12)
    for share in np.linspace(0.0, 1.0, 200):  # no other power costs less
        other_w = p.low_w[:count] + share * (p.high_w - p.low_w)[:count]
        assert (cost_g(other_w, net_w) - store * off_w >= dearer_g - 1e-9).all()
    np.testing.assert_array_equal(plan.coming.shares, plan.share[:count])


@pytest.mark.slow
@pytest.mark.skipif(compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("car", ["paper-liion", "prius-liion"])
def test_c_runs_as_python_does_with_a_full_battery_and_for_heat(car: str) -> None:
    """A start near the upper SOC limit, in the cold: room for braking, and runs for heat."""
    start = {
        "thermal.t_amb_degc": -5.566082,
        "trip.soc_init": 0.779444,
        "trip.t_cl_init_degc": 43.303724,
    }
    runs = [
        drive_in(made_in, "random-9361-286s", car, start, "mh-costate")
        for made_in in ("python", "c")
    ]
    assert_same_commands(*runs)
