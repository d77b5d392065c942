"""What a user states about a log because the file does not."""

from pathlib import Path

import numpy as np
import pytest

from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.cycles.read_drive import read_drives
from qpmpc.errors import InputError

SPEED_MPS = [0.0, 0, 1.5, 4, 7, 9, 10, 10, 9.5, 8, 8, 8, 6, 3, 1, 0, 0]


def log(tmp_path: Path, header: str, speed: float = 1.0, time: float = 1.0, more: str = "") -> Path:
    path = tmp_path / "log.csv"
    rows = "".join(f"{time * k},{speed * v!r}{more}\n" for k, v in enumerate(SPEED_MPS))
    path.write_text(f"{header}\n{rows}")
    return path


@pytest.mark.parametrize(
    ("header", "units", "speed", "time"),
    [
        ("time_s,speed", {"speed": "km/h"}, 3.6, 1.0),
        ("time_s,speed", {"speed": "m/s"}, 1.0, 1.0),
        ("time_s,Velocity", {"speed": " MPH "}, 1 / 0.44704, 1.0),
        ("time,v", {"speed": "knots", "time": "ms"}, 1 / 0.514444, 1000.0),
        ("time_s,speed_kmh", {"speed": "kph"}, 3.6, 1.0),  # the same under another name
    ],
)
def test_a_unit_that_the_file_does_not_name(tmp_path, header, units, speed, time):
    (drive,) = read_drives(log(tmp_path, header, speed, time), LogOptions(units)).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, SPEED_MPS, atol=1e-9)


def test_it_is_said_to_be_stated(tmp_path):
    (drive,) = read_drives(log(tmp_path, "time_s,speed", 3.6), LogOptions({"speed": "kmh"})).drives
    assert "speed from 'speed', in kmh as stated" in [each.text for each in drive.said]


@pytest.mark.parametrize(
    ("header", "options", "words"),
    [
        ("time_s,speed", {}, "state it with qpmpc convert --speed-unit"),
        ("t,speed_kmh", {}, "state it with qpmpc convert --time-unit"),
        ("time_s,speed_mps", {"units": {"speed": "km/h"}}, "--speed-unit says km/h: one of them"),
        ("time_s,speed_kmh", {"units": {"speed": "mph"}}, "in kmh, --speed-unit says mph"),
        (
            "time_s,speed_mps",
            {"units": {"grade": "%"}},
            "--grade-unit: there is no column of grade",
        ),
        ("time_s,speed_mps", {"units": {"elevation": "m"}}, "--elevation-unit: there is no column"),
        ("time_s,speed_mps", {"speed_column": "x"}, "no such column; there are 'time_s', 'speed"),
        ("time_s,speed_mps", {"trip": "1"}, "--trip has no effect: the file names no trips"),
        ("time_s,x", {"units": {"speed": "m/s"}}, "no column of speed; there are 'time_s', 'x'"),
    ],
)
def test_contradictions_and_options_without_effect_are_refused(tmp_path, header, options, words):
    with pytest.raises(InputError) as caught:
        read_drives(log(tmp_path, header), LogOptions(**options))
    assert words in str(caught.value)


def test_a_unit_that_is_none():
    with pytest.raises(InputError, match=r"--speed-unit 'furlong': must be one of m/s, "):
        LogOptions({"speed": "furlong"})


def test_a_unit_of_time_for_dates_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,speed_mps\n2026-01-01T00:00:00,0\n2026-01-01T00:00:09,1\n")
    with pytest.raises(InputError, match="--time-unit: 'time' has no numbers but '2026-01-01T"):
        read_drives(path, LogOptions({"time": "s"}))


def test_the_column_of_speed_by_its_name(tmp_path):
    path = log(tmp_path, "time_s,speed_kmh,GPS Speed [m/s]", 3.6, more=",3")
    with pytest.raises(InputError, match=r"speed is in two columns, .*--speed-column takes one"):
        read_drives(path)
    (drive,) = read_drives(path, LogOptions(speed_column="speed_kmh")).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, SPEED_MPS, atol=1e-9)
    path = log(tmp_path, "time_s,wheel", 3.6)
    options = LogOptions({"speed": "km/h"}, speed_column="wheel")
    np.testing.assert_allclose(read_drives(path, options).drives[0].cycle.speed_mps, SPEED_MPS)
