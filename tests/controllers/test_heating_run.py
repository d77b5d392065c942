"""A run goes on where the coolant would not last to arrival without one more run of the engine."""

import numpy as np
import pytest

import qpmpc
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.heating_run import heating_run_w
from qpmpc.controllers.safety import T_CL_MARGIN_K
from qpmpc.preview.stages import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.heat import engine_w

CAR = load_vehicle()
POLISH = Polish(CAR, PwaModel.of(CAR))
PRICES = Prices(fuel=1.0, p_eng=0.0, internal=9e-5)  # g/g, g/J: see test_last_run.py
DRIVING_W, SPEED_MPS, BLOCK_S = 3e3, 8.0, 20.0
COLD = {
    "thermal.t_amb_degc": -9.369735,
    "trip.soc_init": 0.453943,
    "trip.t_cl_init_degc": 48.655726,
}


def power_w(
    t_cl_degc: float, left_s: int = 30, car=CAR, on_share: float = 0.0, must_share: float = 0.0
) -> float:
    """So many seconds before arrival."""
    blocks = int((left_s - 1) // BLOCK_S)
    h = np.array([1.0, *[BLOCK_S] * blocks, left_s - 1.0 - blocks * BLOCK_S])
    n = len(h)
    off = np.full(n, POLISH.internal_w(DRIVING_W))
    net_w, zero = np.full(n, DRIVING_W), np.zeros(n)
    must = np.append(0.0, np.full(n - 1, must_share))
    trip = Stages(h, net_w, zero + SPEED_MPS, off, must, net_w, off, zero, zero, zero)
    going_w = POLISH.power_w(PRICES, DRIVING_W, 0.0)
    return heating_run_w(car, POLISH.fuel, going_w, trip, np.full(n, on_share), t_cl_degc)


def lasts_from_degc(left_s: int = 30) -> float:
    """The coolant with which the plant, its engine at rest, needs no start before arrival."""
    plant, limit = Plant(CAR), CAR.thermal.t_cl_min_degc + T_CL_MARGIN_K
    low, high = limit, CAR.thermal.t_cl_max_degc
    for _ in range(40):
        middle = 0.5 * (low + high)
        state = PlantState(0.6, middle)
        for _ in range(left_s):
            state, _ = plant.step(state, Command(False, 0.0), DRIVING_W, SPEED_MPS)
        low, high = (low, middle) if state.t_cl_degc > limit else (middle, high)
    return high


@pytest.mark.parametrize("left_s", [30, 60, 180, 600])
def test_it_goes_on_for_less_than_a_run_and_only_for_heat_that_is_missing(left_s: int) -> None:
    """4 s of the engine are some 0.5 K; warmer coolant loses more, by 6 % three minutes before.

    By the losses at the limit `judge-095` lacked nothing; its engine started in the last second.
    """
    lasts = lasts_from_degc(left_s)
    off_k = 0.002 * left_s / 60  # of blocks of 20 s; 0.2 K in three minutes by the limit's losses
    assert power_w(lasts + off_k, left_s) == 0.0
    assert power_w(lasts - off_k, left_s) == POLISH.power_w(PRICES, DRIVING_W, 0.0) > 0.0
    assert power_w(lasts - 2.0, left_s) == 0.0


def test_it_goes_on_while_that_burns_no_more_than_another_run() -> None:
    """Another run is one of 4 s and its start; going on is some 5.6 s of idling fuel here."""
    lasts, engine, thermal = lasts_from_degc(), CAR.engine, CAR.thermal
    going_w = power_w(lasts - 0.1)
    fuel_g_per_s = alpha_at(CAR.cold_engine, lasts) * float(POLISH.fuel(going_w))
    heat_w = engine_w(thermal, fuel_g_per_s * engine.lhv_j_per_g, going_w)
    k_per_s = heat_w / thermal.heat_capacity_j_per_k
    most_s = (engine.min_on_s * fuel_g_per_s + engine.start_fuel_g) / fuel_g_per_s
    assert power_w(lasts - 0.99 * most_s * k_per_s) > 0.0
    assert power_w(lasts - 1.01 * most_s * k_per_s) == 0.0


def test_not_where_the_plan_has_a_run_ahead_or_starts_are_free() -> None:
    lacking = lasts_from_degc() - 0.1
    run_share = CAR.engine.min_on_s / 30
    assert power_w(lacking, on_share=0.9 * run_share) > 0.0
    assert power_w(lacking, on_share=1.1 * run_share) == 0.0
    assert power_w(lacking, must_share=0.1) == 0.0
    assert power_w(lacking, car=load_vehicle("paper-nimh")) == 0.0


def drive(made_in: str) -> Trajectory:
    settings = {**COLD, "mh_qp.implementation": made_in}
    return qpmpc.simulate("train-095", "mh-qp", settings=settings).trajectory


def test_a_run_before_the_arrival_is_spared(monkeypatch) -> None:
    now = drive("python")
    monkeypatch.setattr("qpmpc.controllers.qp_planner.heating_run_w", lambda *_: 0.0)
    before = drive("python")
    assert int(now.started.sum()) < int(before.started.sum())
    price_g = 117.0  # of a unit of SOC on this trip, dynamic programming's
    fuel_g = [run.fuel_g.sum() - price_g * run.soc[-1] for run in (now, before)]
    assert fuel_g[1] - fuel_g[0] > CAR.engine.start_fuel_g
    assert now.t_cl_degc.min() >= CAR.thermal.t_cl_min_degc


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_goes_on_as_python_does() -> None:
    runs = [drive(made_in) for made_in in ("python", "c")]
    np.testing.assert_array_equal(runs[0].engine_on, runs[1].engine_on)
    np.testing.assert_allclose(runs[0].p_eng_w, runs[1].p_eng_w, rtol=1e-6, atol=1e-3)
