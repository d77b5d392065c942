"""Tracks in GPX files: speed from positions or as recorded, elevation as recorded."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.columns import ASSUMED, LEFT_OUT, READ, LogColumns, Said
from qpmpc.cycles.logs.extra import need
from qpmpc.cycles.logs.positions import speed_from_positions
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.problems import shown_value

AGREE = 0.1
"""Largest difference in distance between recorded speeds and positions, else these are used."""

NAMESPACES_MAX = 100

_DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")


def read_gpx(path: Path, megabytes: int, options: LogOptions) -> LogColumns:
    """Read the points of all tracks of a GPX file; several tracks are several trips.

    Speed is what the points have as ``speed`` in m/s, if its distance is that of the positions,
    otherwise from the positions (see `qpmpc.cycles.logs.positions`).

    Raises
    ------
    InputError
        If the file cannot be read, declares entities or a document type, which could grow without
        limit or name other files, has no track with times, or if the options have no effect.
    """
    need(path, "gpxpy")
    for stated, option in (
        *((True, f"--{name}-unit") for name in options.units),
        (options.speed_column is not None, "--speed-column"),
    ):
        if stated:
            raise InputError(f"{path}: {option} has no effect: a GPX file has units and names")
    points = _points(path, read_text(path, megabytes))
    number = [k for k, _, _ in points]
    track = tuple(str(name) for _, name, _ in points)
    time_s = np.array([point.time.timestamp() for _, _, point in points])
    lat, lon = (np.array([getattr(p, a) for _, _, p in points]) for a in ("latitude", "longitude"))
    _check(path, number, (np.abs(lat) <= 90.0) & (np.abs(lon) <= 180.0), "has no valid position")
    # a step back in time begins another track, or is refused with its point when it is checked
    speed, how = _speed(time_s, lat, lon, [_recorded_mps(point) for _, _, point in points])
    said = [how]
    height = [np.nan if p.elevation is None else p.elevation for _, _, p in points]
    elevation_m = np.array(height, dtype=np.float64)
    known = bool(np.any(np.isfinite(elevation_m)))
    if not known:
        said.append(Said(ASSUMED, "a level road: no point has an elevation"))
    return LogColumns(
        number,
        time_s,
        speed,
        elevation_m=elevation_m if known else None,
        trips=track if len(set(track)) > 1 else None,
        said=tuple(said),
        row="point",
    )


def _points(path: Path, text: str) -> list[tuple[int, int, Any]]:
    """Points with times: their numbers, the number of the track, and gpxpy's point."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{path}: declares a document type or entities: not read, GPX has none")
    if text.count("xmlns") > NAMESPACES_MAX:  # gpxpy takes the square of their number in time
        raise InputError(f"{path}: more than {NAMESPACES_MAX} namespaces: not read")
    import gpxpy

    try:
        # without its declaration: it is UTF-8, whatever encoding that names
        gpx = gpxpy.parse(_DECLARATION.sub("", text))
    except Exception as error:  # of gpxpy, lxml or xml.etree: the file is another's text
        raise InputError(f"{path}: not a GPX file: {shown_value(str(error))}") from None
    found = [
        (track, point)
        for track, each in enumerate(gpx.tracks, start=1)
        for segment in each.segments
        for point in segment.points
    ]
    for k, (_, point) in enumerate(found, start=1):
        if point.time is None:
            raise InputError(f"{path}, point {k}: has no time")
    points = [(k, track, point) for k, (track, point) in enumerate(found, start=1)]
    if len(points) < 2:
        raise InputError(f"{path}: {len(points)} track point(s), at least 2 are needed")
    return points


def _recorded_mps(point: Any) -> float:
    """Speed of a point; NaN where it has none."""
    if point.speed is not None:  # GPX 1.0
        return float(point.speed)
    for extension in point.extensions:
        for element in extension.iter():
            if isinstance(element.tag, str) and element.tag.rpartition("}")[2] == "speed":
                try:
                    return float(element.text or "nan")
                except ValueError:
                    return float("nan")
    return float("nan")


def _speed(time_s: Floats, lat: Floats, lon: Floats, recorded: list[float]) -> tuple[Floats, Said]:
    positions, how = speed_from_positions(time_s, lat, lon)
    said = Said(READ, how)
    given = np.array(recorded)
    if not np.any(np.isfinite(given)):
        return positions, said
    if not np.all(np.isfinite(given)):
        missing = int(np.sum(~np.isfinite(given)))
        return positions, Said(READ, f"{how}: {missing} of {len(given)} points have no speed")
    step_s = np.diff(time_s)
    by_speed, by_position = (
        float(np.sum((v[:-1] + v[1:]) / 2 * step_s)) for v in (given, positions)
    )
    if abs(by_speed - by_position) > AGREE * max(by_position, 1.0):
        text = (
            f"{how}: the recorded speeds in m/s would make {by_speed / 1e3:.2f} km, the positions "
            f"{by_position / 1e3:.2f} km"
        )
        return positions, Said(LEFT_OUT, text)
    return given, Said(READ, "speed as recorded, in m/s, in agreement with the positions")


def _check(path: Path, number: list[int], good: Any, what: str) -> None:
    if not np.all(good):
        raise InputError(f"{path}, point {number[int(np.argmin(good))]}: {what}")
