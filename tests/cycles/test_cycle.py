"""The grid of 1 s and what is derived from it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.errors import InputError

Floats = NDArray[np.float64]


@st.composite
def samples(draw: st.DrawFn) -> tuple[Floats, Floats]:
    """Uneven times from any origin, and speeds."""
    steps = draw(
        st.lists(st.floats(0.05, 7.0), min_size=1, max_size=40).filter(lambda s: sum(s) >= 1)
    )
    time = draw(st.floats(-100, 1e6)) + np.concatenate([[0.0], np.cumsum(steps)])
    speed = draw(st.lists(st.floats(0, 70), min_size=len(time), max_size=len(time)))
    return time, np.array(speed)


def test_steps_of_a_ramp() -> None:
    cycle = Cycle("ramp", np.arange(4), np.array([1.0, 3.0, 5.0, 4.0]), np.array([0, 0.1, 0.1, 0]))
    assert cycle.steps == 3
    assert cycle.duration_s == 3
    np.testing.assert_array_equal(cycle.step_speed_mps, [2, 4, 4.5])
    np.testing.assert_array_equal(cycle.step_accel_mps2, [2, 2, -1])
    np.testing.assert_allclose(cycle.step_grade, [0.05, 0.1, 0.05])
    assert cycle.distance_m == 10.5


def test_cycle_cannot_be_changed() -> None:
    speed = np.array([0.0, 1.0])
    cycle = Cycle("c", np.arange(2), speed, np.zeros(2))
    speed[1] = 9.0
    assert cycle.speed_mps[1] == 1.0
    for array in (cycle.time_s, cycle.speed_mps, cycle.grade, cycle.step_speed_mps):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        cycle.name = "other"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("time", "speed", "grade", "message"),
    [
        ([0, 1, 2], [0, 1], [0, 0, 0], "differ in length"),
        ([0, 1], [0, 1], [0], "differ in length"),
        ([0, 2], [0, 1], [0, 0], "must be 0, 1, 2"),
        ([1, 2], [0, 1], [0, 0], "must be 0, 1, 2"),
        ([0], [0], [0], "at least 2"),
        ([0, 1], [0, np.nan], [0, 0], "speed_mps must be a finite"),
        ([0, 1], [0, -1], [0, 0], "must not be negative"),
        ([0, 1], [[0, 1]], [0, 0], "speed_mps must be a finite vector"),
    ],
)
def test_wrong_arrays(time: object, speed: object, grade: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Cycle("c", np.array(time), np.array(speed), np.array(grade))


@pytest.mark.parametrize("time", [[0, 1, 1], [0, 2, 1], [0, np.nan, 2], [3]])
def test_samples_must_increase(time: list[float]) -> None:
    with pytest.raises(InputError, match="must increase"):
        Cycle.from_samples("c", time, [0.0] * len(time))


@given(samples())
def test_resampling_keeps_speeds_between_their_neighbours(drawn: tuple[Floats, Floats]) -> None:
    time, speed = drawn
    cycle = Cycle.from_samples("c", time, speed)
    span = time[-1] - time[0]
    assert 0 <= span - cycle.duration_s < 1 or cycle.duration_s - span <= 1e-6
    for t, v in zip(cycle.time_s, cycle.speed_mps, strict=True):
        after = min(int(np.searchsorted(time - time[0], t)), len(time) - 1)
        before = max(after - 1, 0)
        low, high = sorted((speed[before], speed[after]))
        assert low - 1e-9 <= v <= high + 1e-9


@given(st.lists(st.floats(0, 70), min_size=2, max_size=50), st.floats(-1e3, 1e3).map(round))
def test_samples_at_1_hz_are_left_alone(speed: list[float], origin_s: int) -> None:
    cycle = Cycle.from_samples("c", origin_s + np.arange(len(speed)), speed)
    np.testing.assert_array_equal(cycle.speed_mps, speed)


@given(
    st.lists(st.floats(0, 30), min_size=2, max_size=20),
    st.sampled_from([2, 3, 5, 10]),
)
def test_distance_of_whole_seconds_is_kept(speed: list[float], step_s: int) -> None:
    """Samples on whole seconds are points of the grid: the trapezoids keep their area."""
    time = step_s * np.arange(len(speed))
    cycle = Cycle.from_samples("c", time, speed)
    assert cycle.distance_m == pytest.approx(np.trapezoid(speed, time), abs=1e-6)


def test_fine_time_steps_do_not_lose_the_last_second() -> None:
    """Ten times 0.1 is a little less than 1 in floating point."""
    time = np.cumsum(np.full(101, 0.1)) - 0.1
    assert Cycle.from_samples("c", time, np.full(101, 2.0)).duration_s == 10
