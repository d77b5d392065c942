"""`mh-costate` has the rules of the coming second, each second at its own prices."""

import numpy as np
import pytest
from short_trip import assert_same_commands, drive_in

from qpmpc import Trip, load_vehicle
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.mh_costate import MhCostate
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
    """Their least-cost power, and what they cost more than with the engine off."""
    trip = Trip("nycc", load_vehicle(CAR))
    controller, seen = MhCostate(trip), trip.observation(0, trip.plant.initial_state())
    controller.depart(seen)
    plan = controller.solve(seen)
    stages, program, going = plan.stages, plan.program, plan.coming.going
    count = program.short
    np.testing.assert_array_equal(going.power_w, plan.power_w[:count])
    curves = program.curves
    off_w = stages.internal_off_w[:count]
    on_w = curves.internal_w(stages.net_w[:count] - going.power_w)
    np.testing.assert_allclose(going.gain_w, off_w - on_w, rtol=1e-9, atol=1e-9)
    # per second, at lambda and nu of each
    store = plan.at.charge[:count] * program.charge_per_w[:count]
    assert plan.coming.store_g_per_j == store[0]
    nu = (program.fuel_cost[0] - plan.coming.fuel_g_per_g) / program.per_fuel[0]
    spent = plan.coming.fuel_g_per_g * curves.fuel_g_per_s(going.power_w[:1])
    spent += nu * program.per_power[0] * going.power_w[:1]
    np.testing.assert_allclose(going.dearer_g_per_s[:1], spent - store[:1] * going.gain_w[:1])
