"""The last run of the engine: the one before goes on for it, or it begins in good driving."""

import numpy as np
import pytest
from bare_seconds import going, second
from short_trip import assert_same_commands, drive_in

import qpmpc
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.last_run import last_run_w, last_start_w
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.preview.stages import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle import load_vehicle

CAR = load_vehicle()
POLISH = Polish(CAR, PwaModel.of(CAR))
# a gram of fuel is worth a gram; a joule in the battery what the engine makes it for, 0.09 g/kJ
PRICES = Prices(fuel=1.0, p_eng=0.0, internal=9e-5)
DRIVING_W, FAST_W = 3e3, 14e3
SECONDS = 20


def stages(
    wanted_j: float,
    must_share: float = 0.0,
    now_w: float = DRIVING_W,
    then_w: float = DRIVING_W,
    soon_share: float = 0.0,
) -> tuple[Stages, np.ndarray]:
    """Twenty seconds of driving and a minute to arrival, in which the plan takes some energy.

    A share of it in those seconds, the rest in the minute; from the eleventh on they ask for
    `then_w`.
    """
    h = np.append(np.ones(SECONDS), 60.0)
    net_w = np.repeat([now_w, then_w, DRIVING_W], [10, SECONDS - 10, 1])
    off_w = np.array([POLISH.internal_w(w) for w in net_w.tolist()])
    zero = np.zeros(SECONDS + 1)
    must = np.append(np.zeros(SECONDS), must_share)
    trip = Stages(h, net_w, zero + 8.0, off_w, must, net_w, off_w, zero, zero, zero)
    taken_w = np.append(np.full(SECONDS, soon_share / SECONDS), (1.0 - soon_share) / 60.0)
    return trip, off_w - wanted_j * taken_w


def power_w(wanted_j: float, car=CAR, prices=PRICES, must_share: float = 0.0) -> float:
    trip, internal_w = stages(wanted_j, must_share)
    of_plan = going(POLISH, prices, trip, SECONDS)
    return last_run_w(car.engine, of_plan, prices.fuel, trip, internal_w)


GOING_W = POLISH.power_w(PRICES, DRIVING_W, 0.0)
GAIN_W = POLISH.internal_w(DRIVING_W) - POLISH.internal_w(DRIVING_W - GOING_W)


@pytest.mark.parametrize(
    ("seconds", "goes_on"), [(0.0, False), (1.9, False), (2.1, True), (3.9, True), (4.1, False)]
)
def test_it_goes_on_for_what_would_be_one_more_run(seconds, goes_on) -> None:
    """Half of the shortest run, 4 s, is the least that a plan starts the engine for."""
    assert CAR.engine.min_on_s == 4
    assert power_w(seconds * GAIN_W) == (GOING_W if goes_on else 0.0)


def test_not_where_that_is_dearer_than_a_start() -> None:
    """Free starts, or energy in the battery that is worth little, are no reason to go on."""
    value = 5e-5
    cheap = Prices(1.0, 0.0, value)
    going_w = POLISH.power_w(cheap, DRIVING_W, 0.0)
    gain_w = POLISH.internal_w(DRIVING_W) - POLISH.internal_w(DRIVING_W - going_w)
    wanted_j = 3.5 * gain_w
    dearer_g = (
        (float(POLISH.pieces.fuel_g_per_s(np.array(going_w))) - value * gain_w) * wanted_j / gain_w
    )
    assert dearer_g > CAR.engine.start_fuel_g
    assert power_w(wanted_j, prices=cheap) == 0.0
    assert power_w(wanted_j, CAR.with_settings({"engine.start_fuel_g": 5.0}), cheap) == going_w
    free = CAR.with_settings({"engine.start_fuel_g": 0.0, "engine.start_energy_j": 0.0})
    assert power_w(wanted_j, free) == 0.0


def test_not_where_a_second_ahead_has_to_run_anyway() -> None:
    assert power_w(3.0 * GAIN_W, must_share=0.05) == 0.0


def test_not_where_the_plan_wants_heat() -> None:
    """There a gram of fuel is worth nearly all that it costs as heat."""
    heating = PRICES._replace(fuel=0.4, internal=0.4 * PRICES.internal)
    assert POLISH.power_w(heating, DRIVING_W, 0.0) == GOING_W  # only ratios of prices matter to it
    assert power_w(3.0 * GAIN_W, prices=heating) == 0.0


def test_not_for_nothing_beside_a_full_battery() -> None:
    """A charge that is worth little lets the engine idle: that gives the battery nothing."""
    idle = Prices(1.0, 0.0, 1e-6)
    assert POLISH.power_w(idle, DRIVING_W, 0.0) < DRIVING_W
    assert power_w(10.0, prices=idle) == 0.0


USUAL = Prices(fuel=1.08, p_eng=0.0, internal=6.5e-5)  # under way, heat of fuel set off
RUN = [second(POLISH, USUAL, FAST_W)] * CAR.engine.min_on_s
RUN_J = sum(each.gain_w for each in RUN)


def start_w(
    runs: float,
    car=CAR,
    now_w=FAST_W,
    then_w=DRIVING_W,
    soon_share=0.8,
    must_share=0.0,
    prices=USUAL,
) -> float:
    """So many runs are wanted, each of what a shortest one gives now."""
    gives_j = car.engine.min_on_s * second(POLISH, prices, now_w).gain_w
    trip, internal_w = stages(runs * gives_j, must_share, now_w, then_w, soon_share)
    of_plan = going(POLISH, prices, trip, SECONDS)
    return last_start_w(car.engine, of_plan, prices.fuel, trip, internal_w)


@pytest.mark.parametrize(
    ("runs", "begins"), [(0.4, False), (0.6, True), (1.0, True), (1.4, True), (1.6, False)]
)
def test_it_begins_where_a_shortest_run_pays_for_its_start(runs, begins) -> None:
    assert sum(each.dearer_g_per_s for each in RUN) < -CAR.engine.start_fuel_g
    assert start_w(runs) == (RUN[0].power_w if begins else 0.0)


@pytest.mark.parametrize(("of_start", "begins"), [(1.01, True), (0.99, False)])
def test_it_pays_as_long_as_it_best_lasts(of_start, begins) -> None:
    """Ten seconds of it, then slow driving, for 0.85 of a start; four alone do not pay for one."""
    good = second(POLISH, USUAL, 10e3)
    slow = second(POLISH, USUAL, DRIVING_W)
    assert good.dearer_g_per_s < 0.0 < slow.dearer_g_per_s
    fuel_g = -10.0 * good.dearer_g_per_s / (0.85 * of_start)
    car = CAR.with_settings({"engine.start_fuel_g": fuel_g})
    assert -4.0 * good.dearer_g_per_s < 0.5 * fuel_g
    assert (start_w(1.0, car, now_w=10e3) > 0.0) is begins


def test_it_waits_for_better_seconds() -> None:
    """Slow driving does not pay for a start; what the plan wants later, it may get at less cost."""
    easy = second(POLISH, USUAL, DRIVING_W)
    assert 4.0 * easy.dearer_g_per_s > -CAR.engine.start_fuel_g
    assert start_w(1.0, now_w=DRIVING_W) == 0.0
    assert start_w(1.0, then_w=FAST_W + 4e3) == 0.0
    assert start_w(1.0, then_w=FAST_W - 4e3) > 0.0
    assert start_w(1.0, soon_share=0.51) > 0.0
    assert start_w(1.0, soon_share=0.49) == 0.0


def test_it_is_no_start_that_something_else_decides() -> None:
    """Free starts, a second that has to run anyway, heat, an arrival nearer than a run lasts."""
    free = CAR.with_settings({"engine.start_fuel_g": 0.0, "engine.start_energy_j": 0.0})
    heating = USUAL._replace(fuel=0.4, internal=0.4 * USUAL.internal)
    assert start_w(1.0, free) == start_w(1.0, must_share=0.05) == 0.0
    assert start_w(1.0, prices=heating) == 0.0
    assert start_w(1.0, CAR.with_settings({"engine.min_on_s": SECONDS + 1})) == 0.0


ROAD = "train-057"
OF_ROAD = {
    "thermal.t_amb_degc": -14.908427,
    "trip.soc_init": 0.776437,
    "trip.t_cl_init_degc": 74.1441,
}
SOC_G = 165.0  # of a unit of SOC on this trip, dynamic programming's


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, ROAD, "prius-liion", OF_ROAD)


def test_a_start_before_the_arrival_is_spared(monkeypatch) -> None:
    """Two and a half minutes; without it the last run is one too many."""
    now = drive("python")
    monkeypatch.setattr("qpmpc.controllers.coming_second.last_run_w", lambda *_: 0.0)
    before = drive("python")
    starts = [int(run.started.sum()) for run in (now, before)]
    assert starts[0] == starts[1] - 1
    fuel_g = [run.fuel_g.sum() - SOC_G * run.soc[-1] for run in (now, before)]
    assert fuel_g[1] - fuel_g[0] > CAR.engine.start_fuel_g


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_goes_on_as_python_does() -> None:
    runs = [drive(made_in) for made_in in ("python", "c")]
    assert_same_commands(*runs)


def test_the_last_run_begins_while_the_car_drives(monkeypatch) -> None:
    """Without it the last start is at standstill before arrival."""
    now = drive("python")
    monkeypatch.setattr("qpmpc.controllers.coming_second.last_start_w", lambda *_: 0.0)
    before = drive("python")
    last = [int(np.flatnonzero(run.started)[-1]) for run in (now, before)]
    assert now.demand_w[last[0]] > 5e3 > before.demand_w[last[1]]
    fuel_g = [run.fuel_g.sum() - SOC_G * run.soc[-1] for run in (now, before)]
    assert fuel_g[1] - fuel_g[0] > 1.5 * CAR.engine.start_fuel_g


def test_it_is_left_out_where_the_power_is_not_polished(monkeypatch) -> None:
    part = Cycle.from_samples("part", np.arange(121), load_cycle("nycc").speed_mps[60:181])
    for polish in (False, True):
        asked = []
        monkeypatch.setattr(
            "qpmpc.controllers.coming_second.last_run_w",
            lambda *_, of=asked: float(of.append(1) or 0),
        )
        settings = {"mh_qp.implementation": "python", "mh_qp.polish": polish}
        run = qpmpc.simulate(part, "mh-qp", settings=settings)
        assert run.trajectory.engine_on.any()
        assert bool(asked) is polish
