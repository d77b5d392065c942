"""Grade from elevation: on hills that are known, with the noise that receivers have."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.cycles.logs.columns import LogColumns
from qpmpc.cycles.logs.elevation import with_grade
from qpmpc.cycles.logs.smooth import smoothed
from qpmpc.cycles.trips import make_trip
from qpmpc.errors import InputError

TRIPS = [f"train-{k:03d}" for k in range(3, 43, 8)]


def noise(points: int, sigma_m: float, time_s: float, seed: int) -> np.ndarray:
    """First-order noise, as of a receiver's height."""
    rng = np.random.default_rng(seed)
    pole, state = np.exp(-1.0 / time_s), rng.normal()
    found = np.empty(points)
    for k, drawn in enumerate(rng.normal(size=points)):
        state = pole * state + np.sqrt(1 - pole**2) * drawn
        found[k] = sigma_m * state
    return found


def error_and_climb(sigma_m: float, time_s: float, whole: bool = False) -> tuple[float, float]:
    """Rms error of the grade over the way, and climb as a share of the true one, on all trips."""
    squares, way_m, climbs = 0.0, 0.0, np.zeros(2)
    for seed, name in enumerate(TRIPS):
        trip = make_trip(name)
        rise = np.concatenate([[0.0], np.cumsum(trip.step_speed_mps * trip.step_grade)])
        height = 300.0 + rise + (noise(len(rise), sigma_m, time_s, seed) if sigma_m else 0.0)
        height = np.round(height) if whole else height
        log = LogColumns(range(len(rise)), trip.time_s, trip.speed_mps, elevation_m=height)
        grade = with_grade(log).grade
        assert grade is not None
        found = (grade[:-1] + grade[1:]) / 2
        squares += float(np.sum((found - trip.step_grade) ** 2 * trip.step_speed_mps))
        way_m += trip.distance_m
        climbs += [
            float(np.sum(np.maximum(g, 0.0) * trip.step_speed_mps))
            for g in (found, trip.step_grade)
        ]
    return np.sqrt(squares / way_m), climbs[0] / climbs[1]


@pytest.mark.parametrize(
    ("sigma_m", "time_s", "whole", "error", "climb"),
    [
        # those of the module's table, on other trips
        (0.0, 1.0, True, 0.004, (0.85, 1.02)),
        (1.0, 30.0, False, 0.005, (0.9, 1.1)),
        (3.0, 30.0, False, 0.011, (1.0, 1.4)),
    ],
)
def test_error_on_known_hills(sigma_m, time_s, whole, error, climb):
    rms, share = error_and_climb(sigma_m, time_s, whole)
    assert rms < error
    assert climb[0] < share < climb[1]


@settings(max_examples=50, deadline=None)
@given(
    slope=st.floats(-0.2, 0.2),
    start=st.floats(-400.0, 4000.0),
    speed=st.floats(1.0, 40.0),
    hertz=st.sampled_from([0.2, 1.0, 10.0]),
)
def test_a_straight_slope_is_kept_to_both_ends(slope, start, speed, hertz):
    time = np.arange(0.0, 600.0 / speed + 10.0, 1.0 / hertz)
    speeds = np.full(len(time), speed)
    log = LogColumns(range(len(time)), time, speeds, elevation_m=start + slope * speed * time)
    np.testing.assert_allclose(with_grade(log).grade, slope, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(values=st.lists(st.floats(-100, 100), min_size=1, max_size=60), deviation=st.floats(0.3, 20))
def test_the_filter_is_linear_keeps_lines_and_never_overshoots_a_constant(values, deviation):
    z = np.array(values)
    line = 3.0 + 0.5 * np.arange(len(z))
    np.testing.assert_allclose(smoothed(line, deviation), line, atol=1e-9)
    np.testing.assert_allclose(smoothed(-2.0 * z + line, deviation), -2.0 * smoothed(z, deviation)
                               + line, atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(
        smoothed(z[::-1], deviation)[::-1], smoothed(z, deviation), atol=1e-9
    )


def test_drift_while_standing_makes_no_grade():
    speed = np.concatenate([np.full(60, 10.0), np.zeros(600), np.full(60, 10.0)])
    height = 100.0 + noise(len(speed), 5.0, 60.0, seed=1)
    height[:60], height[660:] = 100.0, 100.0
    log = LogColumns(range(len(speed)), np.arange(720.0), speed, elevation_m=height)
    grade = with_grade(log).grade
    # the mean of ten minutes is within 4 m: over the 150 m of the filter at most some percent
    assert np.abs(grade).max() < 0.02
    assert np.ptp(grade[65:655]) == 0.0  # one place, one grade


HILL_M = 100.0 + 10.0 * (1.0 - np.cos(np.arange(301) * 10.0 / 3000.0 * 2 * np.pi))


def write(path: Path, header: str, extra: str = "") -> Path:
    rows = "".join(f"{k},36.0,{z:.2f}{extra}\n" for k, z in enumerate(HILL_M.tolist()))
    path.write_text(f"{header}\n{rows}")
    return path


def test_a_column_of_elevation_is_read(tmp_path):
    """A hill of 20 m over 3 km: at most 2.1 %, 0.95 of it after the filter."""
    cycle = load_cycle(write(tmp_path / "log.csv", "time_s,speed_kmh,Altitude [m]"))
    assert 0.019 < cycle.grade.max() < 0.021
    way = cycle.time_s * 10.0
    expected = 10.0 * 2 * np.pi / 3000.0 * np.sin(way / 3000.0 * 2 * np.pi)
    np.testing.assert_allclose(cycle.grade[30:-30], expected[30:-30], atol=0.0012)
    # the ends are continued as straight lines
    np.testing.assert_allclose(cycle.grade, expected, atol=0.006)
    said = " ".join(cycle.remarks)
    assert "elevation from 'Altitude [m]', in m" in said
    assert "Gaussian filter over 150 m of way, rise over run; of 20 m of climb" in said
    in_feet = load_cycle(write(tmp_path / "feet.csv", "time_s,speed_kmh,elevation_ft"))
    np.testing.assert_allclose(in_feet.grade, 0.3048 * cycle.grade, atol=1e-12)


def test_of_grade_and_elevation_the_grade_is_read(tmp_path):
    path = write(tmp_path / "log.csv", "time_s,speed_kmh,elevation_m,grade", ",0.01")
    cycle = load_cycle(path)
    assert np.all(cycle.grade == 0.01)
    assert f"{path}: elevation 'elevation_m': the grade is there" in cycle.remarks


def test_an_elevation_without_a_unit_is_not_used_and_that_is_said(tmp_path):
    cycle = load_cycle(write(tmp_path / "log.csv", "time_s,speed_kmh,Altitude"))
    assert not cycle.grade.any()
    assert "a level road: elevation 'Altitude' names no unit" in " ".join(cycle.remarks)
    assert "--elevation-unit" in " ".join(cycle.remarks)


def test_holes_in_the_elevation_are_bridged_and_said(tmp_path):
    path = write(tmp_path / "log.csv", "time_s,speed_kmh,elevation_m")
    lines = path.read_text().splitlines()
    whole = load_cycle(path)
    lines[100:110] = [line.rpartition(",")[0] + ",-" for line in lines[100:110]]
    path.write_text("\n".join(lines))
    cycle = load_cycle(path)
    np.testing.assert_allclose(cycle.grade, whole.grade, atol=1e-3)
    assert "elevation missing in 10 rows: between its neighbours" in " ".join(cycle.remarks)


def test_beyond_the_elevation_the_road_is_level(tmp_path):
    path = write(tmp_path / "log.csv", "time_s,speed_kmh,elevation_m")
    lines = path.read_text().splitlines()
    lines[100:] = [line.rpartition(",")[0] + "," for line in lines[100:]]
    path.write_text("\n".join(lines))
    grade = load_cycle(path).grade
    assert grade[50] > 0.015
    assert not grade[105:].any()


def test_a_cliff_is_refused_with_its_line(tmp_path):
    path = write(tmp_path / "log.csv", "time_s,speed_kmh,elevation_m")
    lines = path.read_text().splitlines()
    lines[150:] = [line.rpartition(",")[0] + ",900" for line in lines[150:]]
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"line \d+: grade is .*from elevation, no road is so"):
        load_cycle(path)
