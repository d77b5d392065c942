"""Stages: what the horizon says of the road is what the road is, in a fixed number of slots."""

import cvxpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.preview.stages import starts_per_rise
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.must_run import must_run, whole_runs

VEHICLE = load_vehicle()
NYCC = Trace.of(load_cycle("nycc"), VEHICLE)


@settings(max_examples=60, deadline=None)
@given(
    step=st.integers(0, NYCC.steps - 1),
    short=st.integers(1, 30),
    blocks=st.integers(1, 40),
    classes=st.sampled_from([1, 3]),
)
def test_time_energy_and_distance_ahead_are_conserved(step, short, blocks, classes):
    layout = HorizonSettings(short_stages=short, blocks=blocks, classes=classes)
    builder = StageBuilder(VEHICLE, NYCC, NYCC, layout)
    stages = builder.at(step)
    net = NYCC.battery_side_w(VEHICLE)[step:]
    assert len(stages.duration_s) == builder.count  # one dimension from departure to arrival
    assert stages.duration_s.sum() == pytest.approx(NYCC.steps - step)
    assert stages.duration_s @ stages.net_w == pytest.approx(net.sum(), abs=1e-3)
    internal = NYCC.internal_off_w(VEHICLE)[step:].sum()
    planned = stages.duration_s @ stages.internal_off_w
    if classes == 3:
        assert planned == pytest.approx(internal, abs=1e-3)
    elif not must_run(VEHICLE, net, NYCC.speed_mps[step:]).any():
        # averaging hides losses: the loss curve is convex up to the battery's limit
        assert planned <= internal + 1e-3
    ahead = NYCC.speed_mps[step:].sum()
    assert stages.duration_s @ stages.speed_mps == pytest.approx(ahead, abs=1e-6)
    assert np.all(stages.duration_s >= 0.0)


def test_short_stages_are_the_next_seconds():
    builder = StageBuilder(VEHICLE, NYCC, NYCC, HorizonSettings(short_stages=10))
    stages = builder.at(100)
    np.testing.assert_array_equal(stages.duration_s[:10], 1.0)
    expected = NYCC.battery_side_w(VEHICLE)[100:110]
    np.testing.assert_allclose(stages.net_w[:10], expected)


def test_long_stages_hold_their_demand_class():
    layout = HorizonSettings()
    stages = StageBuilder(VEHICLE, NYCC, NYCC, layout).at(0)
    aux = VEHICLE.battery.aux_power_w
    for offset, low, high in (
        (0, layout.class_hard_w, np.inf),
        (1, layout.class_braking_w, layout.class_hard_w),
        (2, -np.inf, layout.class_braking_w),
    ):
        demand = stages.net_w[layout.short_stages + offset :: 3] - aux
        there = stages.duration_s[layout.short_stages + offset :: 3] > 0
        assert np.all(demand[there] >= low - 1e-9)
        assert np.all(demand[there] <= high + 1e-9)


@settings(max_examples=60, deadline=None)
@given(step=st.integers(0, NYCC.steps - 1), short=st.integers(1, 30), blocks=st.integers(1, 40))
def test_rises_are_those_of_the_demand_beyond_the_short_horizon(step, short, blocks):
    layout = HorizonSettings(short_stages=short, blocks=blocks)
    builder = StageBuilder(VEHICLE, NYCC, NYCC, layout)
    found = builder.preview(step).long.rises.reshape(blocks, 3)
    edges = layout.edges(min(step + short, NYCC.steps), NYCC.steps)
    demand = NYCC.demand_w
    for block in range(blocks):
        inside = range(edges[block], edges[block + 1])
        hard = sum(demand[t - 1] <= layout.class_hard_w < demand[t] for t in inside)
        easy = sum(demand[t - 1] < layout.class_braking_w <= demand[t] for t in inside)
        assert list(found[block]) == [hard, easy, 0.0]
    stages = builder.at(step)
    counted = min(short, NYCC.steps - step)
    np.testing.assert_array_equal(stages.rises[:counted], 1.0)
    np.testing.assert_array_equal(stages.rises[counted:short], 0.0)
    # what rises from the easy to the hard seconds falls from the hard stage to the easy one
    has = stages.duration_s[short:].reshape(blocks, 3) > 0.0
    for number, of_class in enumerate(stages.rises[short:].reshape(blocks, 3)):
        there = np.flatnonzero(has[number])
        for k in range(3):
            if len(there) and there[0] < k <= there[-1]:
                counted = max(found[number, k - 1] - layout.entry_share, 0.0)
                assert of_class[k] == -layout.rise_share * counted
            else:
                assert of_class[k] == layout.entry_share


@given(
    shares=st.lists(st.floats(0.0, 1.0), min_size=12, max_size=12),
    has=st.lists(st.booleans(), min_size=12, max_size=12),
    rises=st.lists(st.integers(0, 4), min_size=12, max_size=12),
    before=st.floats(0.0, 1.0),
)
def test_classes_without_a_second_hand_the_on_share_on(shares, has, rises, before):
    """Starts that a plan pays for at least: those of the chain of the classes that are there."""
    layout = HorizonSettings()
    counted = starts_per_rise(np.array(rises, float), np.array(has, float), layout)
    there = [k for k in range(12) if has[k]]
    paid, last = 0.0, (-1, before)
    for k in there:
        step = shares[k] - last[1]
        if last[0] // 3 == k // 3 and last[0] >= 0:
            falls = counted[last[0] + 1 : k + 1]
            paid += max(float(falls.max()) * step, 0.0)
        else:
            paid += max(layout.entry_share * step, 0.0)
        last = (k, shares[k])
    # on-shares of the others, free of cost by themselves: what makes the fewest starts
    share, starts = cvxpy.Variable(12), 0.0
    for k in range(12):
        previous = before if k == 0 else share[k - 1]
        starts += cvxpy.pos(float(counted[k]) * (share[k] - previous))
    limits = [share >= 0.0, share <= 1.0, *(share[k] == shares[k] for k in there)]
    least = cvxpy.Problem(cvxpy.Minimize(starts), limits).solve(solver="CLARABEL")
    assert least == pytest.approx(paid, abs=1e-5)


@pytest.mark.parametrize("classes", [1, 3])
def test_means_of_the_seconds_with_a_choice_are_those_of_their_seconds(classes):
    """Of a car whose battery is weak in the cold: class by class, block by block."""
    car = load_vehicle()
    trace = Trace.of(load_cycle("udds"), car)
    layout = HorizonSettings(classes=classes)
    builder = StageBuilder(car, trace, trace, layout)
    net, off = trace.battery_side_w(car), trace.internal_off_w(car)
    must = whole_runs(car, must_run(car, net, trace.speed_mps))
    long = builder.preview(0).long
    edges, mixed = layout.edges(layout.short_stages, trace.steps), 0
    for block in range(layout.blocks):
        seconds = np.arange(edges[block], edges[block + 1])
        hard = trace.demand_w[seconds] > layout.class_hard_w
        braking = trace.demand_w[seconds] < layout.class_braking_w
        for number, member in enumerate((hard, ~hard & ~braking, braking)[:classes]):
            of_class = seconds[member] if classes == 3 else seconds
            stage = block * classes + number
            free = of_class[~must[of_class]] if classes == 3 else of_class
            if not len(free):  # nothing to choose: as all seconds of the class
                assert long.free_net_w[stage] == long.net_w[stage]
                assert long.free_internal_off_w[stage] == long.internal_off_w[stage]
                continue
            mixed += len(free) < len(of_class)
            assert long.free_net_w[stage] == pytest.approx(net[free].mean(), abs=1e-6)
            if classes == 3:
                mean_w = off[free].mean()
                assert long.free_internal_off_w[stage] == pytest.approx(mean_w, abs=1e-6)
    assert mixed >= 5 if classes == 3 else mixed == 0


def test_an_averaged_preview_knows_no_rises():
    builder = StageBuilder(VEHICLE, NYCC, NYCC, HorizonSettings(classes=1))
    assert not builder.at(0).rises[builder.settings.short_stages :].any()


def test_the_forecast_fills_the_long_horizon_only():
    twice = Trace(2.0 * NYCC.demand_w, NYCC.speed_mps)
    builder = StageBuilder(VEHICLE, NYCC, twice, HorizonSettings())
    honest = StageBuilder(VEHICLE, NYCC, NYCC, HorizonSettings())
    short = slice(0, 5)
    np.testing.assert_allclose(builder.at(40).net_w[short], honest.at(40).net_w[short])
    assert not np.allclose(builder.at(40).net_w[5:], honest.at(40).net_w[5:])


def test_braking_is_clipped_at_the_charge_limit():
    hard = Trace(np.array([-60e3, 150e3]), np.array([20.0, 20.0]))
    net = hard.battery_side_w(VEHICLE)
    assert net.tolist() == [-VEHICLE.battery_charge_max_w, VEHICLE.battery_discharge_max_w + 71e3]


def test_shift_moves_short_stages_up_and_keeps_long_ones():
    builder = StageBuilder(VEHICLE, NYCC, NYCC, HorizonSettings(short_stages=4))
    source = builder.shift().tolist()
    assert source[:4] == [1, 2, 3, 3]
    assert source[4:] == list(range(4, builder.count))


@settings(max_examples=200, deadline=None)
@given(
    first=st.integers(0, 2000),
    left=st.integers(0, 2000),
    blocks=st.integers(1, 40),
    short=st.integers(1, 60),
    passed=st.integers(0, 3),
)
def test_blocks_share_out_what_is_ahead_and_none_is_short(first, left, blocks, short, passed):
    layout = HorizonSettings(short_stages=short, blocks=blocks)
    edges = layout.edges(first, first + left)
    assert edges[0] == first
    assert edges[-1] == first + left
    long_s = np.diff(edges)
    full = long_s[long_s > 0][1:]  # all but the first, which passes
    assert np.all(full >= short)
    assert np.ptp(long_s) <= 1 or np.all(full <= max(short, -(-left // blocks)))
    later = layout.edges(min(first + passed, first + left), first + left)
    assert np.all((later - edges >= 0) & (later - edges <= passed))  # no faster than the car


def test_blocks_of_a_length_stay_at_their_place():
    layout = HorizonSettings(blocks=0, block_s=100)
    assert layout.edges(20, 350).tolist() == [20, 100, 200, 300, 350]
    assert layout.edges(150, 350).tolist() == [150, 150, 200, 300, 350]
    assert layout.edges(350, 350).tolist() == 5 * [350]


def test_places_cover_the_trip():
    for steps in (1, 7, 598, 790, 1800):
        layout = HorizonSettings()
        assert layout.block_count(steps) * layout.place_s(steps) >= steps
        assert layout.block_count(steps) <= layout.blocks
