"""Tracks: a known drive on the globe comes back from its positions."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.cycles.logs.positions import EARTH_M
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.cycles.read_drive import read_drives
from qpmpc.errors import InputError

BEGIN = datetime(2026, 3, 28, 23, 58, tzinfo=UTC)
NYCC = load_cycle("nycc")


def track(
    cycle: Cycle,
    *,
    speed: float | None = None,
    height: bool = True,
    noise_m: float = 0.0,
    lon: float = 179.999,
    every: int = 1,
) -> str:
    """Points of a drive that winds north-east, over the date line."""
    way = np.concatenate([[0.0], np.cumsum(cycle.step_speed_mps)])
    heading = 0.8 + 0.5 * np.sin(way / 300.0)
    steps = np.diff(way)
    rng = np.random.default_rng(1)
    north, east = (
        np.concatenate([[0.0], np.cumsum(steps * part(heading[1:]))])
        + noise_m * rng.normal(size=len(way))
        for part in (np.cos, np.sin)
    )
    lat = 52.0 + np.degrees(north / EARTH_M)
    lons = lon + np.degrees(east / EARTH_M / np.cos(np.radians(lat)))
    lons = (lons + 180.0) % 360.0 - 180.0
    points = []
    for k in range(0, len(way), every):
        ele = f"<ele>{100 + 0.02 * way[k]:.2f}</ele>" if height else ""
        moment = (BEGIN + timedelta(seconds=k)).isoformat().replace("+00:00", "Z")
        extra = (
            "<extensions><g:TrackPointExtension><g:speed>"
            f"{speed * cycle.speed_mps[k]:.3f}</g:speed></g:TrackPointExtension></extensions>"
            if speed is not None
            else ""
        )
        points.append(
            f'<trkpt lat="{lat[k]:.8f}" lon="{lons[k]:.8f}">{ele}<time>{moment}</time>{extra}'
            "</trkpt>"
        )
    return f"<trk><trkseg>{''.join(points)}</trkseg></trk>"


def gpx(*tracks: str, head: str = "") -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n{head}<gpx version="1.1" creator="x" '
        'xmlns="http://www.topografix.com/GPX/1/1" '
        'xmlns:g="http://www.garmin.com/xmlschemas/TrackPointExtension/v2">'
        f"{''.join(tracks)}</gpx>"
    )


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "drive.gpx"
    path.write_text(text)
    return path


def test_speed_and_grade_from_positions(tmp_path):
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC))))
    assert cycle.duration_s == NYCC.duration_s
    # the filter of 1.5 s blunts the starts and stops of the city: 0.36 m/s, the way stays
    assert np.sqrt(np.mean((cycle.speed_mps - NYCC.speed_mps) ** 2)) < 0.4
    assert cycle.distance_m == pytest.approx(NYCC.distance_m, rel=0.005)
    assert np.mean(cycle.speed_mps[NYCC.speed_mps == 0] == 0) > 0.8
    np.testing.assert_allclose(cycle.grade, 0.02, atol=0.001)
    assert "speed from positions, Gaussian filter of 1.5 s" in " ".join(cycle.remarks)


def test_noise_of_the_positions_does_not_make_the_way_longer(tmp_path):
    """White noise of 1 m alone would make each second of standing 1.8 m long, 60 % of NYCC."""
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC, noise_m=1.0))))
    assert cycle.distance_m == pytest.approx(NYCC.distance_m, rel=0.06)


def test_points_some_seconds_apart(tmp_path):
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC, every=3))))
    assert cycle.distance_m == pytest.approx(NYCC.distance_m, rel=0.01)


def test_recorded_speed_is_read_if_its_way_is_that_of_the_positions(tmp_path):
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC, speed=1.0))))
    np.testing.assert_allclose(cycle.speed_mps, NYCC.speed_mps, atol=1e-3)
    assert "speed as recorded" in " ".join(cycle.remarks)
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC, speed=3.6))))  # of an app that has km/h
    assert cycle.distance_m == pytest.approx(NYCC.distance_m, rel=0.005)
    assert "the recorded speeds in m/s would make 6.83 km, the positions 1.89 km" in " ".join(
        cycle.remarks
    )


def test_gpx_1_0_has_speed_of_its_own(tmp_path):
    text = (
        gpx(track(NYCC, speed=1.0)).replace('version="1.1"', 'version="1.0"').replace("1/1", "1/0")
    )
    text = text.replace("<extensions><g:TrackPointExtension><g:speed>", "<speed>")
    text = text.replace("</g:speed></g:TrackPointExtension></extensions>", "</speed>")
    np.testing.assert_allclose(
        load_cycle(write(tmp_path, text)).speed_mps, NYCC.speed_mps, atol=1e-3
    )


def test_without_elevation_the_road_is_level_and_that_is_said(tmp_path):
    cycle = load_cycle(write(tmp_path, gpx(track(NYCC, height=False))))
    assert not cycle.grade.any()
    assert "a level road: no point has an elevation" in " ".join(cycle.remarks)


def test_tracks_are_trips(tmp_path):
    path = write(tmp_path, gpx(track(NYCC), track(NYCC, lon=10.0)))
    with pytest.raises(InputError, match=r"2 trips, '1', '2': qpmpc convert takes one with --trip"):
        load_cycle(path)
    (drive,) = read_drives(path, LogOptions(trip="2")).drives
    assert drive.cycle.distance_m == pytest.approx(NYCC.distance_m, rel=0.005)
    both = read_drives(path, split=True).drives
    assert [drive.cycle.name for drive in both] == ["drive-1", "drive-2"]


def points(*places: tuple[object, int]) -> str:
    made = [
        f'<trkpt lat="{lat}" lon="7"><time>2026-01-01T00:00:0{second}Z</time></trkpt>'
        for lat, second in places
    ]
    return gpx(f"<trk><trkseg>{''.join(made)}</trkseg></trk>")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a GPX file"),
        ("<gpx", "not a GPX file"),
        ("<html/>", "0 track point(s), at least 2"),
        (gpx(), "0 track point(s), at least 2"),
        (points((7, 1), (7, 2)).replace("time>", "tim>"), "point 1: has no time"),
        (points((91, 0), (7, 1)), "point 1: has no valid position"),
        (points(("x", 0)), "not a GPX file"),
        (points((7, 5), (7, 1)), "point 2: time_s is"),
        (gpx(head='<!DOCTYPE gpx [<!ENTITY a "b">]>'), "declares a document type or entities"),
        (gpx(head='<!DOCTYPE gpx SYSTEM "file:///etc/passwd">'), "declares a document type"),
        (" xmlns" * 100_000, "more than 100 namespaces"),
        ("<a>" * 100_000, "not a GPX file"),
        ("<a>" * 2000 + "</a>" * 2000, "not a GPX file"),
    ],
)  # fmt: skip
def test_what_is_no_track_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load_cycle(write(tmp_path, text))
    assert words in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400


def test_entities_cannot_hide_behind_another_encoding(tmp_path):
    """UTF-7 writes `<!` as +ADwAIQ-: a parser that obeys the declaration would see a DOCTYPE."""
    hidden = (
        '<?xml version="1.0" encoding="UTF-7"?>+ADwAIQ-DOCTYPE gpx [+ADwAIQ-ENTITY a "b">]>'
        "<gpx><name>&a;</name></gpx>"
    )
    with pytest.raises(InputError, match="not a GPX file"):
        load_cycle(write(tmp_path, hidden))


def test_options_of_tables_are_refused(tmp_path):
    path = write(tmp_path, gpx(track(NYCC)))
    with pytest.raises(InputError, match="--speed-unit has no effect: a GPX file has units"):
        read_drives(path, LogOptions({"speed": "m/s"}))
    with pytest.raises(InputError, match="--speed-column has no effect"):
        read_drives(path, LogOptions(speed_column="x"))


def test_without_gpxpy_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "gpxpy", None)
    with pytest.raises(InputError, match=r"gpxpy, which is not installed: pip install 'qpmpc-iptm"):
        load_cycle(write(tmp_path, gpx(track(NYCC))))
