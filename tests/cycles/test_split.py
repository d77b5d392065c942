"""Several trips in one log, and stamps that repeat."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.cycles.logs.columns import LogColumns
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.cycles.logs.split import KEPT_S, TRIP_MIN_M, TRIP_MIN_S, at_gaps
from qpmpc.cycles.read_drive import read_drives
from qpmpc.errors import InputError

DRIVE = [0.0, 0, *np.arange(1.0, 11), *[10.0] * 40, *np.arange(9.0, -1, -1), 0]
"""63 s, 0.5 km."""

TRIP_M = float(np.sum(DRIVE))


def write(path: Path, rows: list[tuple[object, ...]], header: str = "time_s,speed_mps") -> Path:
    path.write_text(f"{header}\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return path


def rows_at(begin: float, speeds: list[float] = DRIVE) -> list[tuple[object, ...]]:
    return [(begin + k, v) for k, v in enumerate(speeds)]


def test_a_gap_while_moving(tmp_path):
    half = len(DRIVE) // 2
    rows = rows_at(0, DRIVE[:half]) + rows_at(4000, DRIVE[half:])
    path = write(tmp_path / "log.csv", rows)
    with pytest.raises(InputError, match="qpmpc convert --split makes a file of each"):
        load_cycle(path)
    drives, said = read_drives(path, split=True)
    assert [drive.cycle.steps for drive in drives] == [half - 1, len(DRIVE) - half - 1]
    assert [each.text for each in said] == [f"line {half + 2}: 3970 s without a sample: split"]


@pytest.mark.parametrize("sampled", [False, True])
def test_parked_hours(tmp_path, sampled):
    parked = [(63 + k, 0) for k in range(7200)] if sampled else []
    path = write(tmp_path / "log.csv", rows_at(0) + parked + rows_at(63 + 7200))
    drives, said = read_drives(path, split=True)
    assert [drive.cycle.name for drive in drives] == ["log-1", "log-2"]
    for drive in drives:
        assert drive.cycle.distance_m == pytest.approx(TRIP_M)
        stand_s = np.count_nonzero(drive.cycle.speed_mps == 0) - 1
        assert stand_s <= 2 * KEPT_S + 2
    assert "parked for 120 min: split" in said[0].text


def test_parked_hours_in_the_samples_are_a_remark_without_split(tmp_path):
    parked = [(63 + k, 0) for k in range(7200)]
    cycle = load_cycle(write(tmp_path / "log.csv", rows_at(0) + parked + rows_at(7263)))
    assert "stands for 120 min: engine and cabin are kept warm" in cycle.remarks[-1]
    assert "qpmpc convert --split" in cycle.remarks[-1]
    light = [(63 + k, 0) for k in range(290)]
    cycle = load_cycle(write(tmp_path / "log.csv", rows_at(0) + light + rows_at(353)))
    assert not any("stands for" in remark for remark in cycle.remarks)


def test_time_that_begins_anew_and_short_rests(tmp_path):
    moved = rows_at(9000, [0, 1, 2, 1, 0])
    path = write(tmp_path / "log.csv", rows_at(0) + moved + rows_at(0))
    drives, said = read_drives(path, split=True)
    assert [drive.cycle.distance_m for drive in drives] == pytest.approx([TRIP_M, TRIP_M])
    texts = [each.text for each in said]
    assert "line 70: time begins anew: split" in texts
    assert "line 65: 4 s, 4 m left out: no trip" in texts


def test_no_trip_at_all(tmp_path):
    path = write(tmp_path / "log.csv", rows_at(0, [0.0] * 40))
    with pytest.raises(InputError, match="no trip in it: line 2: 39 s, 0 m left out"):
        read_drives(path, split=True)


def test_a_trip_that_is_no_drive_is_left_out_with_the_reason(tmp_path):
    wild = rows_at(9000, [0.0, 0, 30, 0, *DRIVE])
    drives, said = read_drives(write(tmp_path / "log.csv", rows_at(0) + wild), split=True)
    assert len(drives) == 1
    assert "line 67: the speed changes by 30.0 m/s in a second" in said[-1].text


def ved(path: Path, vehicles: tuple[int, int] = (8, 8)) -> Path:
    """As of the vehicle energy data: each trip's time begins at 0."""
    rows = [
        (1.5, vehicle, trip, 1000 * k, 3.6 * v, "NaN")
        for vehicle, trip in zip(vehicles, (706, 707), strict=True)
        for k, v in enumerate(DRIVE)
    ]
    header = "DayNum,VehId,Trip,Timestamp(ms),Vehicle Speed[km/h],OAT[DegC]"
    return write(path, rows, header)


def test_a_column_of_trips(tmp_path):
    path = ved(tmp_path / "ved.csv")
    with pytest.raises(InputError) as caught:
        load_cycle(path)
    assert "2 trips, '706', '707': qpmpc convert takes one with --trip, or" in str(caught.value)
    (drive,) = read_drives(path, LogOptions(trip="707")).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, DRIVE, atol=1e-12)
    assert "all trips but '707'" in [each.text for each in drive.said]
    assert len(read_drives(path, split=True).drives) == 2
    with pytest.raises(InputError, match="--trip '1': there are '706', '707'"):
        read_drives(path, LogOptions(trip="1"))
    several = ved(tmp_path / "cars.csv", vehicles=(8, 9))
    (drive,) = read_drives(several, LogOptions(trip="9-707")).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, DRIVE, atol=1e-12)


@settings(max_examples=100, deadline=None)
@given(
    pieces=st.lists(
        st.tuples(st.sampled_from([1.0, 9.0, 40.0, 400.0]), st.sampled_from([0.0, 0.4, 12.0])),
        min_size=2,
        max_size=120,
    )
)
def test_parts_are_in_order_do_not_overlap_and_have_no_gap(pieces):
    time = np.cumsum([step for step, _ in pieces])
    speed = np.array([v for _, v in pieces])
    rows = range(1, len(time) + 1)
    trips, said = at_gaps(LogColumns(rows, time, speed))
    seen = [row for trip in trips for row in trip.rows]
    assert seen == sorted(set(seen))
    for trip in trips:
        moving = np.maximum(trip.speed_mps[:-1], trip.speed_mps[1:]) > 0.5
        assert np.all(np.diff(trip.time_s)[moving] <= 10.0)
        assert trip.time_s[-1] - trip.time_s[0] >= TRIP_MIN_S
        assert np.sum((trip.speed_mps[:-1] + trip.speed_mps[1:]) / 2 * np.diff(trip.time_s)) >= (
            TRIP_MIN_M
        )
    assert bool(said) or len(seen) == len(time)


def stamped(per_second: int, first: int, last: int) -> tuple[list[float], np.ndarray]:
    """Stamps in whole seconds of a drive at some rate that begins and ends within a second."""
    time = np.arange(per_second - first, 63 * per_second + last) / per_second
    return np.floor(time).tolist(), np.interp(time, np.arange(float(len(DRIVE))), DRIVE)


@pytest.mark.parametrize(
    ("per_second", "first", "last"), [(10, 10, 10), (10, 3, 7), (2, 1, 1), (20, 5, 1)]
)
def test_rows_that_share_a_stamp_are_spread(tmp_path, per_second, first, last):
    stamps, speed = stamped(per_second, first, last)
    path = write(tmp_path / "log.csv", list(zip(stamps, speed.tolist(), strict=True)))
    cycle = load_cycle(path)
    begin = (per_second - first) / per_second
    expected = np.interp(begin + cycle.time_s, np.arange(float(len(DRIVE))), DRIVE)
    np.testing.assert_allclose(cycle.speed_mps, expected, atol=1e-9)
    assert f"each time is there in {per_second} rows: spread evenly" in cycle.remarks[0]


def test_rows_that_share_stamps_unequally_are_refused(tmp_path):
    stamps, speed = stamped(10, 10, 10)
    rows = list(zip(stamps, speed.tolist(), strict=True))
    del rows[304]
    with pytest.raises(InputError, match=r"line 3: 90% of the rows .* not each time equally often"):
        load_cycle(write(tmp_path / "log.csv", rows))
