"""Measurement files: channels with their own rates and the file's units."""

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal

from qpmpc.cycles import load_cycle
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.cycles.read_drive import read_drives
from qpmpc.errors import InputError

TIME_S = np.arange(0.0, 60.05, 0.1)
SPEED_MPS = np.clip(np.minimum(TIME_S, 60.0 - TIME_S), 0.0, 15.0)


def write(path: Path, *groups: list[Signal], version: str = "4.10") -> Path:
    with MDF(version=version) as file:
        for group in groups:
            file.append(group)
        file.save(path, overwrite=True).replace(path)  # it has the suffix of its version
    return path


def speed(name: str = "Vehicle Speed", unit: str = "km/h", scale: float = 3.6) -> Signal:
    return Signal(scale * SPEED_MPS, TIME_S, name=name, unit=unit)


RPM = Signal(800.0 + TIME_S, TIME_S, name="RPM", unit="1/min")


@pytest.mark.parametrize("version", ["4.10", "3.30"])
@pytest.mark.parametrize("name", ["Vehicle Speed", "VehSpd", "ECM.VehicleSpeed", "v_veh"])
def test_speed_in_its_unit(tmp_path, name, version):
    cycle = load_cycle(write(tmp_path / "a.mf4", [RPM, speed(name)], version=version))
    np.testing.assert_allclose(cycle.speed_mps, SPEED_MPS[::10], atol=1e-9)
    assert f"speed from channel '{name}', in km/h" in " ".join(cycle.remarks)
    assert "a level road: no channel of grade or elevation" in " ".join(cycle.remarks)


def test_grade_of_another_rate(tmp_path):
    slope = Signal(np.array([0.0, 6.0]), np.array([0.0, 60.0]), name="Slope", unit="%")
    cycle = load_cycle(write(tmp_path / "a.mdf", [speed()], [slope]))
    np.testing.assert_allclose(cycle.grade, np.arange(61) / 1000.0, atol=1e-12)


def test_elevation_becomes_grade(tmp_path):
    way = np.concatenate([[0.0], np.cumsum((SPEED_MPS[:-1] + SPEED_MPS[1:]) / 20.0)])
    height = Signal(100.0 + 0.05 * way, TIME_S, name="Altitude", unit="m")
    cycle = load_cycle(write(tmp_path / "a.mf4", [speed(), height]))
    np.testing.assert_allclose(cycle.grade, 0.05, atol=1e-6)


def test_a_channel_of_another_name(tmp_path):
    path = write(tmp_path / "a.mf4", [RPM, speed("ESP_v_Signal")])
    with pytest.raises(InputError, match="--speed-column; such as 'ESP_v_Signal'"):
        load_cycle(path)
    (drive,) = read_drives(path, LogOptions(speed_column="ESP_v_Signal")).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, SPEED_MPS[::10], atol=1e-9)


def test_the_unit_of_a_channel_is_asked_for(tmp_path):
    path = write(tmp_path / "a.mf4", [speed(unit="")])
    with pytest.raises(InputError, match=r"names no unit.*--speed-unit"):
        load_cycle(path)
    (drive,) = read_drives(path, LogOptions({"speed": "km/h"})).drives
    np.testing.assert_allclose(drive.cycle.speed_mps, SPEED_MPS[::10], atol=1e-9)
    odd = write(tmp_path / "b.mf4", [speed(unit="furlong")])
    with pytest.raises(InputError, match="unit 'furlong', allowed: m/s"):
        load_cycle(odd)


def test_samples_marked_invalid_are_left_out(tmp_path):
    bad = np.zeros(len(TIME_S), dtype=bool)
    bad[200:210] = True
    values = np.where(bad, 999.0, 3.6 * SPEED_MPS)
    signal = Signal(values, TIME_S, name="Speed", unit="km/h", invalidation_bits=bad)
    cycle = load_cycle(write(tmp_path / "a.mf4", [signal]))
    np.testing.assert_allclose(cycle.speed_mps, SPEED_MPS[::10], atol=1e-9)
    assert "10 of 601 samples of 'Speed' without a value left out" in " ".join(cycle.remarks)


def test_a_channel_that_is_there_twice(tmp_path):
    cycle = load_cycle(write(tmp_path / "a.mf4", [speed()], [speed()]))
    assert "1 more channel(s) 'Vehicle Speed': the first is read" in " ".join(cycle.remarks)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not an MDF file: it does not begin as one"),
        (b"time_s,speed_mps\n0,0\n", "it does not begin as one"),
        (b"MDF     4.10    ", "not an MDF file that asammdf reads"),
        (b"MDF     4.10    " + bytes(range(256)) * 8, "not an MDF file that asammdf reads"),
    ],
)
def test_what_is_none_is_refused_in_one_line(tmp_path, content, words):
    path = tmp_path / "a.mf4"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_cycle(path)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_missing_file_text_channels_and_idle_options(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_cycle(tmp_path / "absent.mf4")
    text = Signal(np.array([b"a", b"b"] * 300 + [b"a"]), TIME_S, name="Speed", unit="km/h",
                  encoding="utf-8")  # fmt: skip
    with pytest.raises(InputError, match="'Speed' is no number over time"):
        load_cycle(write(tmp_path / "a.mf4", [text]))
    path = write(tmp_path / "b.mf4", [speed()])
    for options in (LogOptions({"time": "s"}), LogOptions(trip="1"), LogOptions({"grade": "%"})):
        with pytest.raises(
            InputError, match=r"--time-unit has no|--trip has no|--grade-unit: there"
        ):
            read_drives(path, options)
