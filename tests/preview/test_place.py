"""A forecast is read where the car is on its route."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.preview.forecast import Trace
from qpmpc.preview.forecast_errors import MODELS, forecast
from qpmpc.preview.place import CATCH_UP, forecast_seconds, remark
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle

CAR = load_vehicle()
LONGER = "the forecast has 16.5 km, the trip 1.9 km"  # hwfet for nycc
SPEEDS = st.lists(st.sampled_from([0.0, 1e-9, 3.0, 8.0, 30.0]) | st.floats(0.0, 40.0), min_size=1)


def trace(speed_mps) -> Trace:
    speed = np.array(speed_mps, dtype=float)
    return Trace(np.zeros(len(speed)), speed)


def share_driven(of: Trace) -> np.ndarray:
    way = np.concatenate([[0.0], np.cumsum(of.speed_mps)])
    return way / way[-1]


@given(SPEEDS)
def test_a_true_forecast_is_read_by_the_clock(speed_mps):
    truth = trace(speed_mps)
    assert forecast_seconds(truth, trace(speed_mps)).tolist() == list(range(truth.steps + 1))


@given(SPEEDS, SPEEDS)
def test_it_moves_on_by_no_more_than_two_seconds_and_by_one_while_standing(driven, expected):
    truth, said = trace(driven), trace(expected)
    at = forecast_seconds(truth, said)
    steps = np.diff(at)
    assert at[0] == 0
    assert at[-1] <= said.steps
    assert steps.min() >= 0
    assert steps.max() <= CATCH_UP
    stands = (truth.speed_mps == 0.0) & (at[:-1] < said.steps)
    assert np.all(steps[stands] == 1)


@pytest.mark.parametrize("model", ["travel time", "stops", "speed noise", "combined"])
@pytest.mark.parametrize("cycle", ["nycc", "udds", "wltc-3b"])
def test_it_is_there_where_the_clock_is_early_or_late(cycle, model):
    truth = Trace.of(load_cycle(cycle), CAR)
    said = forecast(load_cycle(cycle), CAR, model, 1)
    by_place = forecast_seconds(truth, said)
    by_clock = np.minimum(np.arange(truth.steps + 1), said.steps)
    driven, there = share_driven(truth), share_driven(said)
    off, off_by_clock = (np.abs(there[at] - driven).mean() for at in (by_place, by_clock))
    assert off < off_by_clock
    assert off < 0.015  # of the way: after a stop shorter than forecast it has to catch up


def test_a_trip_without_a_way_is_read_by_the_clock():
    standing, driving = trace(np.zeros(30)), trace(np.full(20, 10.0))
    for truth, said in ((standing, driving), (driving, standing)):
        at = forecast_seconds(truth, said)
        assert at.tolist() == np.minimum(np.arange(truth.steps + 1), said.steps).tolist()


def test_every_model_of_wrong_forecasts_is_read_to_its_end():
    cycle = load_cycle("udds")
    truth = Trace.of(cycle, CAR)
    for model in MODELS:
        said = forecast(cycle, CAR, model, 3)
        assert said.steps - forecast_seconds(truth, said)[-1] <= 120, model  # a stop at the end


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "hwfet",
            [f"{LONGER}: it is read by the share of its way driven"],
        ),
        ("nycc", []),
    ],
)
def test_a_forecast_of_another_way_is_said_to_be_read(name, said):
    remarks = simulate("nycc", "rule-based", forecast=load_cycle(name)).summary()["remarks"]
    found = [line for line in remarks if line.startswith("the forecast has")]
    assert found == said


def test_a_forecast_without_a_way_is_said_to_be_read_by_the_clock():
    line = remark(trace(np.full(20, 10.0)), trace(np.zeros(30)))
    assert line == "the forecast has 0 km, the trip 0.2 km: it is read by the clock"
    assert remark(trace([0.0]), trace([0.0])) == ""
