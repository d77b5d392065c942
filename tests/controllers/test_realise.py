"""From on-shares to on or off: what a start or a stop binds is what the plan mostly wants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.controllers.realise import STAY_SHARE, engine_runs, power_while_on_w, second_of_power
from qpmpc.simulation import simulate
from qpmpc.trip import Observation
from qpmpc.vehicle import load_vehicle

CAR = load_vehicle()  # a start binds 4 s, a stop 2 s
FREE = load_vehicle("paper-nimh")
OFF = Observation(0, 0.6, 60.0, False, 3e3, 10.0)
ON = OFF._replace(engine_on=True)
SHARES = st.lists(st.floats(-0.1, 1.1), min_size=1, max_size=20).map(np.array)


@pytest.mark.parametrize(
    ("on_share", "arrival_s", "seen", "runs"),
    [
        ([1, 0, 0, 0, 0], None, OFF, False),  # a second's run is not worth four
        ([1, 1, 0, 0, 0], None, OFF, True),
        ([0.4, 1, 1, 1, 1], None, OFF, False),  # not before the plan starts it
        ([0.6, 0.6, 0.4, 0.4, 0], None, OFF, True),
        ([1, 1, 1, 0, 0], 3, OFF, False),  # it could not run for 4 s any more
        ([1, 1, 1, 1, 0], 4, OFF, True),
        ([1, 1, 1], None, OFF, True),  # a plan of 3 s only: nothing is known of the fourth
        ([1, 0, 0, 0, 0], None, OFF._replace(demand_w=30e3), True),  # beyond the battery
        ([1, 0, 0], 1, OFF._replace(demand_w=30e3), True),
        ([0, 1, 1], None, ON, False),  # as long off as on in the 2 s that a stop binds
        ([0.2, 0.9, 1], None, ON, True),
        ([0, 0, 1], None, ON, False),
        ([1, 0, 0], None, ON, True),
        ([0, 1], 1, ON, False),  # what is after arrival does not count
    ],
)
def test_a_change_needs_most_of_the_seconds_that_it_binds(on_share, arrival_s, seen, runs):
    assert engine_runs(np.array(on_share, dtype=float), arrival_s, seen, CAR) is runs


@pytest.mark.parametrize(
    ("on_share", "arrival_s", "runs"),
    [
        ([0.4] * 6, None, True),  # 2.4 s left of the run
        ([0.4] * 4, None, False),  # 1.6 s
        ([0.4, 0.4, 0.1, *[0.45] * 5], None, False),  # what rises again is another start
        ([0.3] * 20, None, False),  # most of what the plan mixes has stopped
        ([0.4] * 6, 4, False),  # what is after arrival does not count
        ([0.4] * 6, 5, True),
        ([0.4, 0.5, 2.0, 2.0], None, False),  # the least so far counts
        ([0.4, -1.0, 0.4, 0.4, 0.4, 0.4, 0.4], None, False),
    ],
)
def test_a_run_goes_on_while_the_plan_has_two_seconds_left_of_it(on_share, arrival_s, runs):
    """A stop would throw them away, and the plan get them back by another start."""
    shares = np.array(on_share)
    given = {"on_share": shares, "arrival_s": arrival_s, "stay_share": STAY_SHARE}
    assert engine_runs(seen=ON, vehicle=CAR, **given) is runs
    assert not engine_runs(seen=OFF, vehicle=CAR, **given)  # no start for them
    assert not engine_runs(seen=ON, vehicle=FREE, **given)  # where a start costs nothing it stops
    assert not engine_runs(shares, arrival_s, ON, CAR)  # shares that rise without a start


def test_power_is_that_of_the_second_or_of_the_next_that_runs():
    share, mean_w = np.array([0.4, 0.3, 0.8, 1.0]), np.array([4e3, 3e3, 4e3, 9e3])
    power_w = power_while_on_w(share, mean_w)
    np.testing.assert_allclose(power_w, [10e3, 0.0, 5e3, 9e3])
    assert second_of_power(share, STAY_SHARE) == 0
    assert second_of_power(share[1:], STAY_SHARE) == 1
    assert second_of_power(share, 0.5) == 2


@pytest.mark.parametrize("seen", [ON, OFF])
def test_the_ramp_starts_the_engine_and_keeps_it_on_whatever_the_plan(seen):
    assert engine_runs(np.zeros(20), None, seen, CAR, least_w=1.0)
    assert engine_runs(np.zeros(2), 2, seen, CAR, least_w=1.0)  # limits come before a short run


FAST = CAR.with_settings({"engine.electric_max_mps": 9.0})  # slower than the car of these seconds


def test_too_fast_a_car_starts_the_engine_and_keeps_it_on_whatever_the_plan():
    for seen in (OFF, ON):
        assert engine_runs(np.zeros(20), None, seen, FAST)
        assert engine_runs(np.zeros(2), 1, seen, FAST)  # limits come before a short run
    assert not engine_runs(np.zeros(20), None, ON._replace(speed_mps=9.0), FAST)


@pytest.mark.parametrize(("fast_s", "runs"), [(None, False), (2, False), (1, True), (-1, False)])
def test_no_stop_before_a_second_that_would_cut_the_rest_short(fast_s, runs):
    assert engine_runs(np.zeros(20), None, ON, CAR, fast_s=fast_s) is runs
    assert not engine_runs(np.zeros(20), None, OFF, CAR, fast_s=fast_s)


@given(SHARES, st.none() | st.integers(1, 19), st.booleans())
def test_an_engine_without_limits_follows_the_share(on_share, arrival_s, engine_on):
    seen = OFF._replace(engine_on=engine_on)
    assert engine_runs(on_share, arrival_s, seen, FREE) == (on_share[0] >= 0.5)


@given(SHARES, st.none() | st.integers(1, 19), st.booleans())
def test_no_change_without_the_share_of_the_second(on_share, arrival_s, engine_on):
    """Looking ahead may keep the engine as it is, but never changes it before the plan does."""
    seen = OFF._replace(engine_on=engine_on)
    wish = on_share[0] >= 0.5
    assert engine_runs(on_share, arrival_s, seen, CAR) in {engine_on, wish}


@pytest.mark.parametrize("cycle", ["nycc", "random-3-187s"])
@pytest.mark.parametrize("car", ["prius-nimh", "prius-liion"])
def test_no_run_is_cut_short_not_even_by_arrival(cycle, car):
    """Where no limit asks for it; arrival would cut off a run that began in the last 3 s."""
    run = simulate(cycle, "mh-qp", car)
    on = run.trajectory.engine_on.astype(int)
    changes = np.diff(on, prepend=0, append=0)
    lengths = np.flatnonzero(changes < 0) - np.flatnonzero(changes > 0)
    assert len(lengths) > 0
    assert lengths.min() >= load_vehicle(car).engine.min_on_s
