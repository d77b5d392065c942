"""The battery at its lower limit: a run goes on, or begins where it costs least."""

import bare_seconds
import numpy as np
import pytest
from bare_seconds import Second, bare_stages, second
from hypothesis import assume, given
from hypothesis import strategies as st
from short_trip import assert_same_commands, drive_in

import qpmpc
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.battery_run import battery_run_w
from qpmpc.controllers.last_run import SAME_G
from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.cycles import Cycle
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

CAR = load_vehicle("prius-liion")
POLISH, PLANT = Polish(CAR, PwaModel.of(CAR)), Plant(CAR)
PRICES = Prices(fuel=1.03, p_eng=0.0, internal=6.0e-5)  # under way, heat of fuel set off
LIMIT = CAR.battery.soc_min + SOC_MARGIN
STANDING_W, SLOW_W, DRIVING_W = 400.0, 5e3, 12e3
SECONDS, SPEED_MPS = 20, 8.0
ENERGY_J = POLISH.maps.energy_j(CAR.battery.soc_min)


def spent_j(net_w) -> np.ndarray:
    """Taken out of the battery by the end of each second, the engine at rest."""
    return np.cumsum([POLISH.internal_w(w) for w in net_w])


def going(net_w: float) -> Second:
    return second(POLISH, PRICES, net_w)


def asked_w(net_w, soc, on_share=(), must=(), on=False, car=CAR, seconds=SECONDS) -> float:
    """Return the power asked for; what is not given of the seconds is 0."""
    count = len(net_w)
    trip = bare_stages(POLISH, net_w, must, seconds, SPEED_MPS)
    share = np.append(on_share, np.zeros(count - len(on_share)))
    seen = Observation(9, soc, 60.0, on, net_w[0], SPEED_MPS, 9, 10e3)
    of_plan = bare_seconds.going(POLISH, PRICES, trip, count)
    return battery_run_w(car, POLISH.maps, of_plan, trip, share, seen)


def soc_with(j: float) -> float:
    """SOC with so much energy above the limit."""
    return LIMIT + j / ENERGY_J


TROUGH = [DRIVING_W] * 4 + [SLOW_W] * 4 + [-SLOW_W] * 12
DEEP_J = spent_j(TROUGH).max()


def test_a_run_goes_on_only_for_what_the_battery_lacks() -> None:
    """Eight seconds of driving, then braking: a kilojoule more or less at the end of them."""
    goes_w = going(DRIVING_W).power_w
    assert asked_w(TROUGH, soc_with(DEEP_J - 1e3), on=True) == goes_w > 0.0
    assert asked_w(TROUGH, soc_with(DEEP_J - 1.0), on=True) == goes_w
    assert asked_w(TROUGH, soc_with(DEEP_J + 1.0), on=True) == 0.0


def test_it_lacks_where_the_plant_ends_below_its_limit() -> None:
    """The plant at rest; the plan's losses are those of SOC 0.6, half a percent of this less."""
    for beyond_j, falls in ((-0.01 * DEEP_J, True), (0.01 * DEEP_J, False)):
        state = PlantState(soc_with(DEEP_J + beyond_j), 60.0)
        lacks = bool(asked_w(TROUGH, state.soc, on=True) > 0.0)
        low = state.soc
        for net_w in TROUGH:
            demand_w = net_w - CAR.battery.aux_power_w
            state, _ = PLANT.step(state, Command(False, 0.0), demand_w, SPEED_MPS)
            low = min(low, state.soc)
        assert lacks is falls is bool(low < LIMIT)


def test_it_goes_on_while_that_costs_no_more_than_another_start() -> None:
    """At standstill, where a second of the engine costs more than a rest at the plan's prices."""
    standing = [STANDING_W] * 4 + [DRIVING_W] * 16
    now = going(STANDING_W)
    most_j = CAR.engine.start_fuel_g * now.gain_w / now.dearer_g_per_s
    deep_j = spent_j(standing).max()
    assert 0.0 < most_j < deep_j
    assert asked_w(standing, soc_with(deep_j - 0.99 * most_j), on=True) == now.power_w
    assert asked_w(standing, soc_with(deep_j - 1.01 * most_j), on=True) == 0.0


def test_not_where_a_run_comes_before_the_limit() -> None:
    """One that the plan wants, or that the road leaves no choice about; free starts; arrival."""
    soc = soc_with(DEEP_J - 1e3)
    free = CAR.with_settings({"engine.start_fuel_g": 0.0, "engine.start_energy_j": 0.0})
    for on in (True, False):
        lacks_by = int(np.argmax(spent_j(TROUGH) > DEEP_J - 1e3))
        assert lacks_by > 4
        assert asked_w(TROUGH, soc, [0.4] * 20, on=on) > 0.0
        assert asked_w(TROUGH, soc, [0.0] * lacks_by + [0.5], on=on) == 0.0
        assert asked_w(TROUGH, soc, must=(lacks_by,), on=on) == 0.0
        assert asked_w(TROUGH, soc, must=(lacks_by + 1,), on=on) > 0.0
        assert asked_w(TROUGH, soc, on=on, car=free) == 0.0
    assert asked_w([DRIVING_W] * 20, LIMIT, seconds=4) > 0.0
    assert asked_w([DRIVING_W] * 20, LIMIT, seconds=3) == 0.0


def test_on_a_steady_road_it_begins_at_the_last_second_that_can() -> None:
    """All starts cost the same, and the need is known better later."""
    steady = [DRIVING_W] * SECONDS
    a_second_j = spent_j(steady)[0]
    for lacks_by in (0, 1, 10):
        begins = asked_w(steady, soc_with((lacks_by + 0.5) * a_second_j)) > 0.0
        assert bool(begins) is (lacks_by == 0)


def test_a_cheaper_run_that_would_end_after_arrival_is_none() -> None:
    """Six seconds to arrival; what stands behind them is not driven."""
    road = [2.0 * SLOW_W, *[SLOW_W] * 5, *[DRIVING_W] * 14]
    assert going(DRIVING_W).dearer_g_per_s < going(2.0 * SLOW_W).dearer_g_per_s
    soc = soc_with(spent_j(road)[4])  # lacks in the sixth
    assert asked_w(road, soc, seconds=6) == going(road[0]).power_w
    assert asked_w(road, soc, seconds=7) == 0.0


@given(
    net_w=st.lists(st.floats(-1e4, 2e4), min_size=SECONDS, max_size=SECONDS),
    spare_j=st.floats(0.0, 1e5),
    run_s=st.integers(0, 6),
    seconds=st.integers(8, SECONDS),
)
def test_it_begins_where_it_costs_least(net_w, spare_j, run_s, seconds) -> None:
    """Against every start up to the first second that would empty the battery."""
    car = CAR.with_settings({"engine.min_on_s": run_s})
    lacks = np.flatnonzero(spent_j(net_w[:seconds]) > spare_j)
    margin_j = np.abs(spent_j(net_w[:seconds]) - spare_j).min()
    assume(margin_j > 1e-3)
    found = asked_w(net_w, soc_with(spare_j), car=car, seconds=seconds)
    if not len(lacks):
        assert found == 0.0
        return
    lasts_s, cost_g = max(run_s, 1), [going(w).dearer_g_per_s for w in net_w]
    of_start = [
        sum(cost_g[start : start + lasts_s])
        for start in range(lacks[0] + 1)
        if start == 0 or start + lasts_s <= seconds
    ]
    best_g = min(of_start[1:], default=np.inf)
    assume(abs(of_start[0] - best_g + SAME_G) > 1e-9)
    assert found == (going(net_w[0]).power_w if of_start[0] < best_g - SAME_G else 0.0)


ROAD = "random-9015-167s"
OF_ROAD = {
    "thermal.t_amb_degc": 7.060178,
    "trip.soc_init": 0.430409,
    "trip.t_cl_init_degc": 70.14404,
}


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, ROAD, CAR.name, OF_ROAD)


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_it_spares_a_start_just_before_braking_in_c_as_in_python(monkeypatch) -> None:
    """Three minutes near the limit: five starts instead of the optimum's three, and 4 % more."""
    now, in_c = drive("python"), drive("c")
    monkeypatch.setattr("qpmpc.controllers.coming_second.battery_run_w", lambda *_: 0.0)
    before = drive("python")
    assert_same_commands(now, in_c)
    assert now.started.sum() == before.started.sum() - 2
    soc_g = 155.0  # of a unit of SOC: dynamic programming's own on this trip
    fuel_g = [run.fuel_g.sum() - soc_g * (run.soc[-1] - run.soc[0]) for run in (now, before)]
    assert fuel_g[0] < 0.96 * fuel_g[1]
    assert now.soc.min() >= CAR.battery.soc_min


def test_a_steady_road_near_the_limit_takes_no_more_starts(monkeypatch) -> None:
    """Ninety seconds at 40 km/h; with the first of equal starts it took four instead of three."""
    time_s = np.arange(91.0)
    ramps = np.clip(np.minimum(time_s, 90.0 - time_s) / 7.0, 0.0, 1.0)
    road = Cycle.from_samples("steady", time_s, 40.0 / 3.6 * ramps)
    settings = {"trip.soc_init": 0.405, "trip.t_cl_init_degc": 70.0, "thermal.t_amb_degc": 10.0}
    settings |= {"mh_qp.implementation": "python"}

    def run() -> Trajectory:
        return qpmpc.simulate(road, "mh-qp", vehicle="prius-liion", settings=settings).trajectory

    now = run()
    monkeypatch.setattr("qpmpc.controllers.coming_second.battery_run_w", lambda *_: 0.0)
    before = run()
    assert now.started.sum() <= before.started.sum()
    soc_g = 140.0  # of a unit of SOC with this battery, on roads like this
    fuel_g = [r.fuel_g.sum() - soc_g * (r.soc[-1] - r.soc[0]) for r in (now, before)]
    assert fuel_g[0] < fuel_g[1]
