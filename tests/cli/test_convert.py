"""`qpmpc convert`, and the remarks of a log on the command line."""

import json

import numpy as np
import pytest
from hostile import TEXT, is_harmless

from qpmpc.cycles import load_cycle

SPEED_KMH = [0, 0, 5, 14, 24, 31, 36, 36, 34, 29, 29, 29, 22, 12, 4, 0, 0]


@pytest.fixture
def log(tmp_path):
    """At 2 Hz, with all that may have to be said."""
    time = np.arange(0.0, 16.1, 0.5)
    speed = np.interp(time, np.arange(17.0), SPEED_KMH)
    rows = [f"{t},{v:.2f},{100 + 0.1 * t:.1f},7" for t, v in zip(time, speed, strict=True)]
    rows[5] = "2.5,-,100.3,7"
    rows[0] = "0.0,-0.1,100.0,7"
    rows.insert(9, rows[8])
    path = tmp_path / "log.csv"
    path.write_text("My logger\ntime_s,speed,Altitude [m],rpm\n" + "\n".join(rows) + "\n")
    return path


def test_the_file_is_the_trip_that_was_read(cli, tmp_path, log, strict_json):
    out = tmp_path / "new" / "trip.csv"
    figures = tmp_path / "trip.json"
    done = cli("convert", log, "--out", out, "--speed-unit", "km/h", "--json", figures)
    assert done.code == 0, done.err
    assert done.err == ""
    assert out.read_text().startswith("time_s,speed_mps,grade\n0,0.0,")
    cycle = load_cycle(out)
    assert cycle.remarks == ()
    whole = np.array(SPEED_KMH) / 3.6
    np.testing.assert_allclose(cycle.speed_mps, whole, atol=0.002)
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    data = strict_json(figures.read_text())
    (trip,) = data["trips"]
    assert (trip["file"], trip["name"], trip["samples"]) == (str(out), "trip", 32)
    assert trip["distance_km"] == pytest.approx(cycle.distance_m / 1e3)
    said = {
        "left out": [
            "1 line(s) above the header not read",
            "not read: 'rpm'",
            "1 of 34 rows without a value left out",
            "1 rows with the time of the row before left out",
        ],
        "read": [
            "speed from 'speed', in km/h as stated",
            "elevation from 'Altitude [m]', in m",
        ],
        "repaired": ["1 speeds between -0.05 and 0 m/s taken for 0"],
        "assumed": ["a level road: 80 m are too short for a grade from elevation"],
    }
    for kind, texts in said.items():
        assert [each["text"] for each in trip["remarks"] if each["kind"] == kind] == texts
        for text in texts:
            assert text in done.out
    assert "mean km/h" in done.out
    assert f"{out} written" in done.out


def test_again_it_says_that_there_is_nothing_to_say(cli, tmp_path, trip):
    done = cli("convert", trip, "--out", tmp_path / "again.csv")
    assert "nothing assumed, nothing repaired, nothing left out" in done.out
    first, again = load_cycle(trip), load_cycle(tmp_path / "again.csv")
    np.testing.assert_array_equal(first.speed_mps, again.speed_mps)


def test_json_to_stdout_and_no_matplotlib(cli, tmp_path, trip, strict_json, no_matplotlib):
    out = tmp_path / "again.csv"
    done = cli("convert", trip, "--out", out, "--json", "-")
    assert strict_json(done.out)["trips"][0]["file"] == str(out)
    assert "again.png not drawn: matplotlib is not installed (pip install 'qpmpc" in done.err
    assert out.exists()


def test_split(cli, tmp_path, strict_json):
    speeds = [0, *range(11), *[10] * 30, *range(10, -1, -1)]
    rows = [f"{begin + k},{v}" for begin in (0, 5000) for k, v in enumerate(speeds)]
    log, out = tmp_path / "log.csv", tmp_path / "day.csv"
    log.write_text("time_s,speed_mps\n" + "\n".join(rows))
    cli("convert", log, "--out", out).assert_refused(
        "4948 s without a sample", "--split makes a file"
    )
    assert not out.exists()
    figures = tmp_path / "day.json"
    done = cli("convert", log, "--out", out, "--split", "--json", figures)
    assert done.code == 0, done.err
    data = json.loads(figures.read_text())
    assert [trip["name"] for trip in data["trips"]] == ["day-1", "day-2"]
    assert data["remarks"] == [{"kind": "left out", "text": "line 56: parked for 82 min: split"}]
    assert "parked for 82 min" in done.out
    assert not out.exists()
    for name in ("day-1", "day-2"):
        assert load_cycle(tmp_path / f"{name}.csv").distance_m == pytest.approx(sum(speeds))
        assert (tmp_path / f"{name}.png").exists()


def test_nothing_is_written_over_another_file_and_nothing_by_halves(cli, tmp_path, log, trip):
    text = trip.read_text()
    cli("convert", trip, "--out", trip).assert_refused("files of their own")
    for name in ("x.csv", "x.png"):
        cli("convert", trip, "--out", tmp_path / "x.csv", "--json", tmp_path / name).assert_refused(
            "files of their own"
        )
    cli("convert", trip, "--out", tmp_path / "x.txt").assert_refused("--out", "ends in .csv")
    (tmp_path / "x.png").mkdir()
    cli("convert", trip, "--out", tmp_path / "x.csv").assert_refused("x.png: is a directory")
    cli("convert", log, "--out", tmp_path / "y.csv").assert_refused("names no unit", "--speed-unit")
    cli("convert", log, "--out", tmp_path / "y.csv", "--speed-unit", "x").assert_refused(
        "--speed-unit 'x': must be one of m/s"
    )
    assert trip.read_text() == text
    assert not (tmp_path / "x.csv").exists()
    assert not (tmp_path / "y.csv").exists()


def test_text_of_the_file_is_shown_harmless(cli, tmp_path):
    rows = "".join(f"{k},{v},1\n" for k, v in enumerate(SPEED_KMH))
    log = tmp_path / "log.csv"
    log.write_text(f"time_s,speed_kmh,{TEXT.replace(chr(10), '')}\n{rows}", "utf-8")
    for args in ((), ("--trip", TEXT), ("--speed-column", TEXT), ("--speed-unit", TEXT)):
        done = cli("convert", log, "--out", tmp_path / "out.csv", *args)
        assert done.code == (2 if args else 0)
        assert is_harmless(done.out + done.err)


def test_the_picture_shows_samples_drive_and_elevation(tmp_path):
    from io import BytesIO

    from matplotlib.colors import to_rgb
    from matplotlib.image import imread

    from qpmpc.cycles.read_drive import read_drives
    from qpmpc.report.drive_picture import draw_drive
    from qpmpc.report.style import BLACK, GREEN, SKY

    log = tmp_path / "log.csv"
    log.write_text(
        "time_s,speed_kmh,elevation_m\n" + "".join(f"{k},50,{100 + k / 9}\n" for k in range(99))
    )
    (drive,) = read_drives(log).drives
    image = imread(BytesIO(draw_drive(drive)))[..., :3]
    for color in (SKY, BLACK, GREEN):
        assert np.sum(np.all(np.abs(image - to_rgb(color)) < 0.01, axis=-1)) > 100
    log.write_text("time_s,speed_kmh\n" + "".join(f"{k},50\n" for k in range(99)))
    lower = imread(BytesIO(draw_drive(read_drives(log).drives[0])))
    assert lower.shape[0] < image.shape[0] - 200  # two panels less


@pytest.mark.parametrize("command", ["simulate", "compare"])
def test_a_remark_on_a_log_is_printed_once(cli, tmp_path, command):
    log = tmp_path / "log.csv"
    log.write_text("t_s;v_kmh\n" + "".join(f"{k};{v}\n" for k, v in enumerate(SPEED_KMH)))
    options = ["--controller" if command == "simulate" else "--controllers", "rule-based"]
    done = cli(command, log, *options)
    assert done.code == 0
    assert (done.out + done.err).count("speed from 'v_kmh', in kmh") == 1
    assert cli("cycles", log).out.count("speed from 'v_kmh', in kmh") == 1
