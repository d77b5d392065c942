"""Logs and schedules as people have them: the same drive under other names and units."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.errors import InputError

SPEED_MPS = [0, 0, 1.5, 4, 7, 9, 10, 10, 9.5, 8, 8, 8, 6, 3, 1, 0, 0]
PARTS = ["time_s", "speed [km/h]", ",", ";", "\t", "\n", "1", "-", '"', "é"]
BEGIN = datetime(2026, 1, 31, 23, 59, 55, tzinfo=UTC)


def rows(row: Callable[[int, float], str]) -> str:
    return "".join(f"{row(k, v)}\n" for k, v in enumerate(SPEED_MPS))


FILES = {
    "units in brackets": "Time [s],Vehicle Speed (km/h)\n" + rows(lambda k, v: f"{k},{v * 3.6!r}"),
    "units in a row": "time_s,speed_mps\ns,m/s\n" + rows(lambda k, v: f"{k},{v}"),
    "units in the name": "time_ms,speed_mph\n" + rows(lambda k, v: f"{1000 * k},{v / 0.44704!r}"),
    "semicolons and decimal commas": "t_s;v_kmh\n"
    + rows(lambda k, v: f"{k},0;{v * 3.6!r}".replace(".", ",")),
    "comments and blank lines": "# logger\n\ntime_s,speed_mps\n# go\n"
    + rows(lambda k, v: f"{k},{v}"),
    "a schedule of the EPA": "Sample Schedule\nTest Time, secs\tTarget Speed, mph\n"
    + rows(lambda k, v: f"{k}\t{v / 0.44704!r}"),
    "FASTSim 2": "cycSecs,cycMps,cycGrade,cycRoadType\n" + rows(lambda k, v: f"{k},{v},0,0"),
    "FASTSim 3": "time_seconds,speed_meters_per_second,grade,road_type\n"
    + rows(lambda k, v: f"{k},{v},0,0"),
    "ISO dates": "time_s,speed_mps\n"
    + rows(lambda k, v: f"{(BEGIN + timedelta(seconds=k)).isoformat()},{v}"),
    "dates with points": "Datetime;Speed [km/h]\n"
    + rows(
        lambda k, v: f"{BEGIN + timedelta(seconds=k):%d.%m.%Y %H:%M:%S};"
        + repr(v * 3.6).replace(".", ",")
    ),
    "times of day, over midnight": "Time,Speed [km/h]\n"
    + rows(lambda k, v: f"{BEGIN + timedelta(seconds=k):%H:%M:%S.0},{v * 3.6!r}"),
    "epochs": "timestamp [ms],speed_mps\n"
    + rows(lambda k, v: f"{1769900000123 + 1000 * k},{v}"),
    "an OBD logger": "GPS Time,Device Time,Speed (OBD)(km/h)\n"
    + rows(
        lambda k, v: f"x,{BEGIN + timedelta(seconds=k):%d-%b-%Y %H:%M:%S}.120,"
        + ("-" if k in (5, 9) else repr(v * 3.6))
    ),
    "vehicle energy data": "DayNum,VehId,Trip,Timestamp(ms),Vehicle Speed[km/h],OAT[DegC]\n"
    + rows(lambda k, v: f"1.5,8,706,{1000 * k},{v * 3.6!r},NaN"),
    "German, decimal commas": "Messung 4\nZeit [s];Fahrzeuggeschwindigkeit [km/h];Höhe über NN\n"
    + rows(lambda k, v: f"{k},0;{v * 3.6!r};212,5".replace(".", ",")),
    "a German app": "Device Time,Geschwindigkeit (OBD)(km/h),GPS Höhe(m)\n"
    + rows(lambda k, v: f"{BEGIN + timedelta(seconds=k):%d-%b-%Y %H:%M:%S}.120,{v * 3.6!r},212"),
    "German, units as DIN 1313 writes them": "Zeit in s;v / (km/h);Höhe / m\n"
    + rows(lambda k, v: f"{k},0;{v * 3.6!r};212,5".replace(".", ",")),
    "German, decimal commas in dates": "Zeitstempel;Geschwindigkeit in km/h\n"
    + rows(
        lambda k, v: f"{BEGIN + timedelta(seconds=k):%d.%m.%Y %H:%M:%S},000;"
        + repr(v * 3.6).replace(".", ",")
    ),
    "German, a row of units": "Zeitstempel;Geschwindigkeit;Steigung\nms;m/s;%\n"
    + rows(lambda k, v: f"{1000 * k};{v!r};0".replace(".", ",")),
    "French": "Temps écoulé (s);Vitesse du véhicule (km/h);Pente (%);Altitude (m)\n"
    + rows(lambda k, v: f"{k};{v * 3.6!r};0;212".replace(".", ",")),
    "Spanish": "Tiempo (seg),Velocidad (km/h),Pendiente (%),Altitud (m)\n"
    + rows(lambda k, v: f"{k},{v * 3.6!r},0,212"),
    "10 Hz": "time_s;speed_mps\n"
    + "".join(f"{k / 10};{float(np.interp(k / 10, range(17), SPEED_MPS))!r}\n" for k in range(161)),
    "noise while standing": "time_s,speed_mps\n"
    + rows(lambda k, v: f"{k},{v if v else -0.01}"),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / "log.txt"
    path.write_text(FILES[name])
    cycle = load_cycle(path)
    expected = np.array(SPEED_MPS, dtype=float)
    if name == "an OBD logger":  # two rows without a value: between their neighbours
        expected[[5, 9]] = 0.5 * (expected[[4, 8]] + expected[[6, 10]])
    np.testing.assert_allclose(cycle.speed_mps, expected, atol=1e-9)


def test_what_was_assumed_is_said(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(FILES["an OBD logger"])
    assert [remark.removeprefix(f"{path}: ") for remark in load_cycle(path).remarks[:5]] == [
        "time from 'Device Time', as dates",
        "speed from 'Speed (OBD)(km/h)', in km/h",
        "a level road: no column of grade or elevation",
        "not read: 'GPS Time'",
        "2 of 17 rows without a value left out",
    ]
    calm = "".join(f"{k},{v}\n" for k, v in enumerate(np.repeat(SPEED_MPS, 2) / 2))
    path.write_text(f"time_s,speed_mps\n{calm}")
    assert not load_cycle(path).remarks


@pytest.mark.parametrize(
    ("slope", "height"),
    [
        ("Steigung (%)", "Höhe (m)"),
        ("Pente (%)", "Altitude (m)"),
        ("Pendiente (%)", "Altitud (m)"),
    ],
)
def test_slope_and_elevation_in_other_languages(tmp_path: Path, slope: str, height: str) -> None:
    """A road that rises by 2 %, once by its slope, once by its elevation."""
    path = tmp_path / "log.csv"
    rising = "".join(f"{k};36;2,0\n" for k in range(60))
    path.write_text(f"Zeit (s);Vitesse (km/h);{slope}\n{rising}")
    np.testing.assert_allclose(load_cycle(path).grade, 0.02)
    rising = "".join(f"{k};36;{0.2 * k!r}\n" for k in range(200)).replace(".", ",")
    path.write_text(f"Zeit (s);Velocidad (km/h);{height}\n{rising}")
    np.testing.assert_allclose(load_cycle(path).grade[80:120], 0.02, atol=1e-3)


def test_a_stamp_that_is_there_twice_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    text = "time_s,speed_mps\n" + "".join(f"{k},{v}\n" for k, v in enumerate(2 * SPEED_MPS))
    path.write_text(text.replace("\n4,7\n", "\n4,7\n4,7\n"))
    cycle = load_cycle(path)
    np.testing.assert_array_equal(cycle.speed_mps, 2 * SPEED_MPS)
    assert "1 rows with the time of the row before left out" in cycle.remarks[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Zeit;Geschwindigkeit [km/h]\n0;0\n1;1\n2;2\n", "'Zeit' names no unit: add one of s, "),
        ("Temps [s];Vitesse\n0;0\n1;1\n2;2\n", "'Vitesse' names no unit: add one of m/s, "),
        ("Tiempo [s];Velocidad [km/s]\n0;0\n1;1\n2;2\n", "unit 'km/s', allowed: m/s"),
        ("time,speed_mps\n0,0\n1,1\n2,2\n3,3\n", "'time' names no unit: add one of s, "),
        ("time_s,speed\n0,0\n1,1\n2,2\n3,3\n4,4\n", "'speed' names no unit: add one of m/s, "),
        ("time_s,speed [furlong]\n0,0\n1,1\n2,2\n3,3\n", "unit 'furlong', allowed: m/s"),
        ('"x, time_s","speed_kmh"\n0,0\n1,1\n2,2\n3,3\n', "columns found"),
        ("time_s,speed_kmh,gps_speed_kmh\n0,0,0\n1,1,1\n", "speed is in two columns"),
        ("time_s,speed_kmh\n0,0\n1,x\n2,2\n3,3\n", "line 3: 'speed_kmh' is 'x'"),
        ("time_s;speed_kmh\n0;0\n1\n2;2\n3;3\n", "line 3: 1 values"),
        ("time,speed_kmh\n2026-01-01T00:00:00,0\nlater,1\n", "line 3: 'time' is 'later', must be"),
        ("time_s,speed_kmh\n0,0\n0,0\n0,0\n1,1\n1,1\n2,2\n", "50% of the rows have the time"),
        ("time_s,speed_kmh\n0,-\n1,-\n2,3\n", "1 row(s) with values"),
        ("time_s,speed_kmh\n0,0\n1,-9\n2,3\n3,0\n", "must not be negative"),
    ],
)
def test_what_cannot_be_known_is_asked_for(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_cycle(path)
    assert said in str(caught.value)
    assert "log.csv" in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400


@settings(max_examples=200, deadline=None)
@given(text=st.text(max_size=200) | st.lists(st.sampled_from(PARTS), max_size=40).map("".join))
def test_any_text_is_read_or_refused_in_one_line(text: str, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text(text, "utf-8", errors="replace")
    said = ""
    try:
        load_cycle(path)
    except InputError as error:
        said = str(error)
    assert said.isprintable()


def test_text_of_a_spreadsheet(tmp_path):
    """Windows-1252: the same drive, and it is said."""
    file = tmp_path / "log.csv"
    text = "Zeit über alles;x\ntime_s;v_kmh;Kühlmittel °C\n" + rows(lambda k, v: f"{k};{3.6 * v};1")
    text = text.replace(".", ",")
    file.write_bytes(text.encode("cp1252"))
    cycle = load_cycle(file)
    assert cycle.speed_mps == pytest.approx(SPEED_MPS)
    assert f"{file}: the text is not UTF-8: read as Windows-1252" in cycle.remarks
    assert f"{file}: 1 line(s) above the header not read" in cycle.remarks
    file.write_text(text, "utf-8")
    assert not [line for line in load_cycle(file).remarks if "1252" in line]


@pytest.mark.parametrize(("title", "level"), [("alt_gps_m", False), ("pressure_hpa", True)])
def test_a_level_road_is_said_to_be_one(tmp_path, title, level):
    file = tmp_path / "log.csv"
    file.write_text(f"time_s,v_kmh,{title}\n" + rows(lambda k, v: f"{k},{3.6 * v},{500 + 2 * k}"))
    said = f"{file}: a level road: no column of grade or elevation" in load_cycle(file).remarks
    assert said is level
