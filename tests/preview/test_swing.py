"""The swing inside a block: by hand, within its cap, and nothing of it in an averaged preview."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.preview.swing import (
    DRAIN_SHARE,
    FALL_SHARE,
    FILLED_SHARE,
    LEAST_KEPT_J,
    NO_LIMIT_J,
    STRETCH_S,
    STRETCHES,
    drops,
    rooms,
    swings,
    uses,
)
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.independent.equations import Equations

CAR = load_vehicle()
NYCC = Trace.of(load_cycle("nycc"), CAR)
AUX_W = CAR.battery.aux_power_w
HARD_W, EASY_W, BRAKING_W = 20e3, 5e3, -9e3


def stored_j(demand_w: float) -> float:
    """What leaves the store in a second with the engine off, by the equations written twice."""
    return float(Equations(CAR).internal_w(CAR.trip.soc_init, demand_w + AUX_W))


EASY_J, BRAKED_J = stored_j(EASY_W), -stored_j(BRAKING_W)  # out of the store, into it
ROOM_J = (
    (CAR.battery.soc_max - CAR.battery.soc_min)
    * float(Equations(CAR).voltage_v(CAR.trip.soc_init))
    * CAR.battery.capacity_ah
    * 3600.0
)


def of_blocks(*blocks: list[float], **changed: float) -> np.ndarray:
    """Fall and rise of blocks of these demands, J."""
    demand = np.concatenate([np.asarray(block) for block in blocks])
    ends = np.cumsum([len(block) for block in blocks])
    starts = ends - [len(block) for block in blocks]
    layout = HorizonSettings(**{"swing_share": 1.0, **changed})
    return swings(Trace(demand, np.full(len(demand), 10.0)), CAR, layout, starts, ends)


def test_an_engine_in_hard_driving_makes_up_for_the_rest() -> None:
    # -B, -2B, -2B + A, and the hard second leads back to 0
    fall, rise = of_blocks([EASY_W, EASY_W, BRAKING_W, HARD_W])
    assert fall[0] == pytest.approx(FALL_SHARE * 2.0 * EASY_J)
    assert rise[0] == pytest.approx(max(BRAKED_J - 2.0 * EASY_J, LEAST_KEPT_J))
    # A, then two hard seconds take half of A - B each, then B out of the store
    fall, rise = of_blocks([BRAKING_W, HARD_W, HARD_W, EASY_W])
    assert fall[0] == LEAST_KEPT_J
    assert rise[0] == pytest.approx(max(BRAKED_J, EASY_J))


def test_without_hard_driving_all_seconds_make_up_for_the_rest() -> None:
    fall, rise = of_blocks([EASY_W, EASY_W, BRAKING_W])
    mean = (2.0 * EASY_J - BRAKED_J) / 3.0
    path = [mean - EASY_J, 2.0 * (mean - EASY_J), 0.0]
    assert fall[0] == pytest.approx(FALL_SHARE * -min(path))
    assert rise[0] == pytest.approx(max(*path, LEAST_KEPT_J))


def test_the_end_of_a_block_keeps_what_the_next_needs_too() -> None:
    falling, rising = [EASY_W, HARD_W], [BRAKING_W, HARD_W]
    np.testing.assert_allclose(
        of_blocks(falling, rising, falling),
        [[FALL_SHARE * EASY_J] * 3, [BRAKED_J, BRAKED_J, LEAST_KEPT_J]],
    )


def test_no_engine_takes_from_the_battery_so_a_descent_ends_above() -> None:
    """It falls no deeper than with the engine at rest, and its own energy is no swing."""
    fall, rise = of_blocks([EASY_W, BRAKING_W, BRAKING_W, BRAKING_W])
    assert fall[0] == pytest.approx(FALL_SHARE * EASY_J)
    assert rise[0] == LEAST_KEPT_J
    modest_w = 10e3  # hard, and within the battery's power
    hard_j = stored_j(modest_w)
    assert hard_j + 2.0 * EASY_J < 9.0 * BRAKED_J
    fall, rise = of_blocks([EASY_W, EASY_W, modest_w] + 9 * [BRAKING_W])
    assert fall[0] == pytest.approx(FALL_SHARE * (2.0 * EASY_J + hard_j))
    assert rise[0] == LEAST_KEPT_J
    fall, rise = of_blocks(9 * [BRAKING_W] + [modest_w, EASY_W])
    assert fall[0] == LEAST_KEPT_J
    assert rise[0] == pytest.approx(hard_j + EASY_J)  # above its end


def test_a_share_is_kept_and_at_most_half_of_the_room() -> None:
    one = of_blocks([EASY_W, HARD_W], swing_share=0.3)
    np.testing.assert_allclose(one, [[FALL_SHARE * 0.3 * EASY_J], [LEAST_KEPT_J]])
    many = int(ROOM_J / min(EASY_J, BRAKED_J)) + 1
    fall, _ = of_blocks([EASY_W] * many + [HARD_W])
    _, rise = of_blocks([BRAKING_W] * many + [HARD_W] * many)
    assert fall[0] == pytest.approx(FALL_SHARE * 0.5 * ROOM_J)
    assert rise[0] == pytest.approx(0.5 * ROOM_J)


def test_constant_demand_and_no_block_swing_not() -> None:
    steady = [EASY_W, EASY_W, EASY_W]
    np.testing.assert_array_equal(of_blocks(steady, [HARD_W]), LEAST_KEPT_J)
    np.testing.assert_array_equal(of_blocks([EASY_W, HARD_W], [])[:, 1], LEAST_KEPT_J)


def test_an_averaged_preview_knows_no_swing() -> None:
    assert np.all(of_blocks([EASY_W, HARD_W, BRAKING_W], classes=1) == LEAST_KEPT_J)
    stages = StageBuilder(CAR, NYCC, NYCC, HorizonSettings(classes=1)).at(0)
    assert np.all(stages.fall_j <= LEAST_KEPT_J)
    assert np.all(stages.rise_j <= LEAST_KEPT_J)


@settings(max_examples=60, deadline=None)
@given(step=st.integers(0, NYCC.steps - 1), short=st.integers(1, 30), blocks=st.integers(1, 40))
def test_soc_is_limited_at_the_ends_of_blocks_that_lie_ahead(step, short, blocks) -> None:
    layout = HorizonSettings(short_stages=short, blocks=blocks)
    builder = StageBuilder(CAR, NYCC, NYCC, layout)
    stages = builder.at(step)
    length = layout.place_s(NYCC.steps)
    start = np.minimum(np.arange(blocks) * length, NYCC.steps)
    end = np.minimum(start + length, NYCC.steps)
    edges = layout.edges(min(step + short, NYCC.steps), NYCC.steps)
    of_end = swings(NYCC, CAR, layout, start, end)[:, (edges[1:] - 1) // length]
    use_j = uses(*(of(NYCC, CAR, layout) for of in (rooms, drops)))[edges[1:] - 1]
    most_j = np.maximum(use_j, LEAST_KEPT_J)
    of_end[1] = np.minimum(of_end[1], most_j)
    ahead = np.diff(edges) > 0
    room_j = rooms(NYCC, CAR, layout)[step + short] if step + short < NYCC.steps else 0.0
    of_seconds = np.zeros((2, short))  # which are known one by one, but not what comes then
    of_seconds[1, -1] = room_j
    for found, kept, of_second in (
        (stages.fall_j, of_end[0], of_seconds[0]),
        (stages.rise_j, of_end[1], of_seconds[1]),
    ):
        np.testing.assert_array_equal(found[:short], of_second)
        of_class = found[short:].reshape(blocks, 3)
        np.testing.assert_array_equal(of_class[:, :2], -NO_LIMIT_J)
        np.testing.assert_array_equal(of_class[:, 2], kept * ahead)


def rooms_of(demand_w: list[float], **changed: int) -> np.ndarray:
    trace = Trace(np.array(demand_w), np.full(len(demand_w), 10.0))
    return rooms(trace, CAR, HorizonSettings(**changed))


def test_braking_ahead_needs_room_and_driving_before_it_makes_some() -> None:
    found = rooms_of([EASY_W, BRAKING_W, BRAKING_W, HARD_W])
    kept = 2.0 * BRAKED_J - DRAIN_SHARE * EASY_J
    np.testing.assert_allclose(found, [kept, 2.0 * BRAKED_J, BRAKED_J, 0.0, 0.0])
    assert rooms_of([EASY_W] * 9 + [BRAKING_W])[0] == 0.0
    assert np.all(rooms_of([BRAKING_W, BRAKING_W], classes=1) == 0.0)


@settings(max_examples=60, deadline=None)
@given(demand_w=st.lists(st.floats(-30e3, 15e3), min_size=1, max_size=400))
def test_a_battery_with_that_room_is_just_not_overfilled(demand_w) -> None:
    room_j = rooms_of(demand_w)
    assert room_j.min() >= 0.0
    assert room_j.max() <= FILLED_SHARE * ROOM_J * (1.0 + 1e-3)  # of energy: at the mean SOC
    trace = Trace(np.array(demand_w), np.full(len(demand_w), 10.0))
    internal_w = trace.internal_off_w(CAR)
    path_j = np.cumsum(np.where(internal_w > 0.0, -DRAIN_SHARE * internal_w, -internal_w))
    if room_j.max() < 0.99 * FILLED_SHARE * ROOM_J:
        assert max(path_j.max(), 0.0) == pytest.approx(room_j[0], abs=1e-3)  # sums of 1e7 J


def drops_of(demand_w: list[float], **changed: float) -> np.ndarray:
    trace = Trace(np.array(demand_w), np.full(len(demand_w), 10.0))
    return drops(trace, CAR, HorizonSettings(**{"swing_share": 1.0, **changed}))


def test_a_drop_is_what_easy_driving_took_since_the_battery_was_highest() -> None:
    found = drops_of([BRAKING_W, EASY_W, EASY_W, EASY_W, EASY_W, HARD_W, BRAKING_W, BRAKING_W])
    down_j = EASY_J * np.arange(5)
    after = [max(4.0 * EASY_J - k * BRAKED_J, 0.0) for k in range(3)]
    np.testing.assert_allclose(found, [0.0, *down_j, *after])
    assert drops_of([EASY_W], swing_share=0.3)[1] == pytest.approx(0.3 * EASY_J)
    assert drops_of([EASY_W] * 3000)[-1] == pytest.approx(FILLED_SHARE * ROOM_J)
    assert np.all(drops_of([EASY_W], classes=1) == 0.0)


@settings(max_examples=60, deadline=None)
@given(demand_w=st.lists(st.floats(-30e3, 15e3), min_size=1, max_size=400))
def test_a_battery_full_at_its_peak_has_at_least_that_drop_with_the_engine_at_rest(demand_w):
    """Hard driving apart, in which the engine may give all."""
    trace = Trace(np.array(demand_w), np.full(len(demand_w), 10.0))
    found = drops_of(demand_w)
    stored_j = np.concatenate([[0.0], -np.cumsum(trace.internal_off_w(CAR))])
    lost_j = np.maximum.accumulate(stored_j) - stored_j
    assert np.all(found >= 0.0)
    assert np.all(found <= lost_j + 1e-3)  # sums of 1e7 J
    easy = trace.demand_w <= HorizonSettings().class_hard_w
    if easy.all() and lost_j.max() < 0.99 * FILLED_SHARE * ROOM_J:
        np.testing.assert_allclose(found, lost_j, atol=1e-3)


@settings(max_examples=60, deadline=None)
@given(steps=st.integers(1, 20_000), seed=st.integers(0, 9))
def test_the_use_of_a_second_is_the_most_in_its_stretch(steps, seed) -> None:
    room_j, drop_j = np.random.default_rng(seed).uniform(0.0, 1e6, (2, steps + 1))
    found = uses(room_j, drop_j)
    length = max(STRETCH_S, math.ceil(steps / STRETCHES))
    assert math.ceil(steps / length) <= STRETCHES
    for second in {0, steps // 2, steps - 1}:
        first = second // length * length
        stretch = slice(first + 1, min(first + length, steps) + 1)
        assert found[second] == max(room_j[stretch].max(), drop_j[stretch].max())


def test_generated_c_has_the_same_stretches() -> None:
    runtime = Path(__file__).parents[2] / "codegen" / "runtime"
    header = (runtime / "mpc_forecast.h").read_text("utf-8")
    found = dict(re.findall(r"#define MPC_(STRETCHES|STRETCH_S) (\d+)", header))
    assert found == {"STRETCHES": str(STRETCHES), "STRETCH_S": str(STRETCH_S)}


def test_no_room_is_kept_where_no_use_for_it_is_seen(monkeypatch) -> None:
    """A block that ends at a peak of the battery kept what the driving after the peak would swing.

    So the plan stayed 0.01 of SOC below a limit that it could reach, for twenty minutes, and ran
    the engine worse: train-076 was 1.7 % above the optimum.
    """
    of_trip = {
        "thermal.t_amb_degc": 4.467951,
        "trip.soc_init": 0.726251,
        "trip.t_cl_init_degc": 57.762471,
    }

    def fuel_g() -> float:
        run = simulate("train-076", "mh-qp", vehicle="prius-liion", settings=of_trip)
        return run.fuel_soc_balanced_g

    now_g = fuel_g()
    monkeypatch.setattr(
        "qpmpc.preview.stages.uses", lambda room_j, _: np.full(len(room_j) - 1, ROOM_J)
    )
    assert now_g < 0.993 * fuel_g()


@pytest.mark.parametrize(("controller", "of"), [("mh-qp", "mh_qp"), ("mh-costate", "mh_costate")])
def test_descents_inside_a_block_find_room_in_a_small_battery(controller, of, monkeypatch) -> None:
    """Two hills within two blocks: without `rooms` they end in the friction brakes."""
    time_s = np.arange(901.0)
    grade = np.zeros(901)
    for start, end, share in (
        *((60, 140, 0.04), (140, 330, -0.035), (330, 480, 0.03)),
        *((560, 700, -0.04), (700, 850, 0.02)),
    ):
        grade[start:end] = share
    speed_mps = np.minimum(14.0, np.minimum(time_s, 900.0 - time_s))
    hills = Cycle("hills", time_s, speed_mps, grade)

    def braked_j() -> float:
        settings = {"trip.soc_init": 0.7, f"{of}.horizon.blocks": 2}
        run = simulate(hills, controller, vehicle="prius-liion", settings=settings)
        braked: float = run.summary()["friction_brake_j"]
        return braked

    assert braked_j() < 1e3
    monkeypatch.setattr("qpmpc.preview.stages.rooms", lambda trace, *_: np.zeros(trace.steps + 1))
    assert braked_j() > 2e5


def blocks_of(*demands: list[float]) -> StageBuilder:
    """Blocks of four seconds beyond a short horizon of two."""
    demand = np.concatenate([[EASY_W, EASY_W], *demands])
    assert len(demand) % 4 == 0
    trace = Trace(demand, np.full(len(demand), 10.0))
    layout = HorizonSettings(short_stages=2, blocks=0, block_s=4, swing_share=1.0)
    return StageBuilder(CAR, trace, trace, layout)


def test_braking_beyond_a_block_refills_less_what_driving_before_it_takes() -> None:
    """By itself, with the engine off: driving after the braking takes nothing back."""
    easy, braking = [EASY_W] * 4, [BRAKING_W] * 4
    stages = blocks_of([EASY_W] * 2, easy, braking, braking, easy).at(0)
    of_block = stages.refill_j[2:].reshape(5, 3)
    assert np.all(of_block[:, :2] == 0.0)
    before_braking_j = 8.0 * BRAKED_J
    expected = [before_braking_j - 4.0 * EASY_J, before_braking_j, 4.0 * BRAKED_J, 0.0, 0.0]
    np.testing.assert_allclose(of_block[:, 2], expected)
    assert np.all(stages.refill_j[:2] == 0.0)


def test_no_block_ahead_no_refill() -> None:
    builder = blocks_of([BRAKING_W] * 2, [BRAKING_W] * 4)
    assert builder.at(0).refill_j.max() == pytest.approx(4.0 * BRAKED_J)
    assert np.all(builder.at(builder.steps - 2).refill_j == 0.0)
    alone = HorizonSettings(short_stages=2, blocks=0, block_s=0)
    assert np.all(StageBuilder(CAR, NYCC, NYCC, alone).at(0).refill_j == 0.0)
