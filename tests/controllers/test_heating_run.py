"""A run goes on where the coolant would not last to arrival without one more run of the engine."""

import numpy as np
import pytest

import qpmpc
from qpmpc.codegen.c_compiler import compiler
from qpmpc.preview.stages import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp.heating_run import heating_run_w
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

CAR = load_vehicle()
POLISH = Polish(CAR, PwaModel.of(CAR))
PRICES = Prices(fuel=1.0, p_eng=0.0, internal=9e-5)  # g/g, g/J: see test_last_run.py
DRIVING_W, SPEED_MPS, LEFT_S = 3e3, 8.0, 30
COLD = {
    "thermal.t_amb_degc": -9.369735,
    "trip.soc_init": 0.453943,
    "trip.t_cl_init_degc": 48.655726,
}


def power_w(t_cl_degc: float, car=CAR, on_share: float = 0.0, must_share: float = 0.0) -> float:
    """Half a minute before arrival."""
    h = np.array([1.0, LEFT_S - 1.0])
    off = np.full(2, POLISH.internal_w(DRIVING_W))
    net_w, zero = np.full(2, DRIVING_W), np.zeros(2)
    must = np.array([0.0, must_share])
    trip = Stages(h, net_w, zero + SPEED_MPS, off, must, net_w, off, zero, zero, zero)
    going_w = POLISH.power_w(PRICES, DRIVING_W, 0.0)
    return heating_run_w(car, POLISH.fuel, going_w, trip, np.full(2, on_share), t_cl_degc)


def lasts_from_degc() -> float:
    """The coolant with which the plant, its engine at rest, arrives just above its limit."""
    plant, limit = Plant(CAR), CAR.thermal.t_cl_min_degc
    low, high = limit, limit + 5.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        state = PlantState(0.6, middle)
        for _ in range(LEFT_S):
            state, _ = plant.step(state, Command(False, 0.0), DRIVING_W, SPEED_MPS)
        low, high = (low, middle) if state.t_cl_degc > limit else (middle, high)
    return high


def test_it_goes_on_for_less_than_a_run_and_only_for_heat_that_is_missing() -> None:
    """4 s of the engine are some 0.5 K; losses are taken at the limit, 1 % less than on the way."""
    lasts = lasts_from_degc()
    assert power_w(lasts + 0.05) == 0.0
    assert power_w(lasts - 0.1) == POLISH.power_w(PRICES, DRIVING_W, 0.0) > 0.0
    assert power_w(lasts - 2.0) == 0.0


def test_not_where_the_plan_has_a_run_ahead_or_starts_are_free() -> None:
    lacking = lasts_from_degc() - 0.1
    run_share = CAR.engine.min_on_s / LEFT_S
    assert power_w(lacking, on_share=0.9 * run_share) > 0.0
    assert power_w(lacking, on_share=1.1 * run_share) == 0.0
    assert power_w(lacking, must_share=0.1) == 0.0
    assert power_w(lacking, load_vehicle("paper-nimh")) == 0.0


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
