"""Time, speed and grade of a log or a schedule, under its own names and in its own units."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.delimited import Column, DelimitedTable, header_names, parse_delimited
from qpmpc.errors import InputError
from qpmpc.problems import shown_value

ABSENT = ("", "-", "nan", "null", "n/a")
"""What loggers write where they have no value."""

TIME_UNITS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "min": 60.0,
}  # fmt: skip
SPEED_UNITS = {
    "m/s": 1.0, "mps": 1.0, "meters_per_second": 1.0, "km/h": 1 / 3.6, "kmh": 1 / 3.6,
    "kph": 1 / 3.6, "kmph": 1 / 3.6, "mph": 0.44704, "mi/h": 0.44704, "kn": 0.514444,
    "knots": 0.514444, "kts": 0.514444,
}  # fmt: skip
GRADE_UNITS = {"m/m": 1.0, "-": 1.0, "1": 1.0, "%": 1e-2, "percent": 1e-2, "pct": 1e-2}

# the first that is there is read; the others of time are said to be left out
TIMES = (
    "time", "t", "test_time", "elapsed_time", "timestamp", "cycsecs", "device_time", "gps_time",
)  # fmt: skip
SPEEDS = (
    "speed", "v", "velocity", "vehicle_speed", "target_speed", "speed_obd", "gps_speed", "cycmps",
)  # fmt: skip
GRADES = ("grade", "road_grade", "gradient", "slope", "cycgrade")
WITH_UNIT = {"cycsecs": 1.0, "cycmps": 1.0, "cycgrade": 1.0, "grade": 1.0}  # FASTSim, and ours

OURS = ("time_s", "speed_mps", "grade")  # of which nothing has to be said

DATES = ("%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S", "%a %b %d %H:%M:%S GMT%z %Y")


@dataclass(frozen=True)
class LogColumns:
    """What a log has of a drive, row by row.

    Attributes
    ----------
    lines : of the file
    time_s, speed_mps, grade : shape (rows,); grade 0 where the file has none
    remarks : what was assumed and left out, one line each
    """

    lines: tuple[int, ...]
    time_s: Floats
    speed_mps: Floats
    grade: Floats
    remarks: tuple[str, ...]


def is_log(text: str) -> bool:
    """Whether the header of a table has a column of time and one of speed."""
    columns = [Column("", name, "", ()) for name in header_names(text)]
    return all(
        any(_split(column, names, units)[0] in names for column in columns)
        for names, units in ((TIMES, TIME_UNITS), (SPEEDS, SPEED_UNITS))
    )


def parse_log(path: Path, text: str) -> LogColumns:
    """Parse the columns of a log.

    Raises
    ------
    InputError
        If a column names no unit or one that is not known, if speed or grade is there twice, or
        if a value is none.
    """
    table = parse_delimited(path, text)
    times, speeds, grades = (
        list(_named(table, names, units))
        for names, units in ((TIMES, TIME_UNITS), (SPEEDS, SPEED_UNITS), (GRADES, GRADE_UNITS))
    )
    for what, found in (("speed", speeds), ("grade", grades)):
        if len(found) > 1:
            raise InputError(
                f"{path}: {what} is in two columns, {shown_value(found[0].title)} and "
                f"{shown_value(found[1].title)}: leave one"
            )
    said: list[str] = []
    time_s = _time_s(table, times[0], said)
    speed_mps = _scaled(table, speeds[0], SPEEDS, SPEED_UNITS, said)
    grade = np.zeros(len(time_s))
    if grades:
        grade = _scaled(table, grades[0], GRADES, GRADE_UNITS, said)
    if table.titles:
        said.insert(0, f"{table.titles} line(s) above the header not read")
    taken = {times[0].title, speeds[0].title, *(column.title for column in grades)}
    left = [column.title for column in table.columns if column.title not in taken]
    if left:
        said.append(
            f"not read: {', '.join(shown_value(title) for title in left[:5])}"
            + (f" and {len(left) - 5} more" if len(left) > 5 else "")
        )
    keep = np.isfinite(time_s) & np.isfinite(speed_mps) & np.isfinite(grade)
    if not np.all(keep):
        said.append(f"{int(np.sum(~keep))} of {len(keep)} rows without a value left out")
    if int(np.sum(keep)) < 2:
        raise InputError(f"{path}: {int(np.sum(keep))} row(s) with values, at least 2 are needed")
    lines = tuple(line for line, kept in zip(table.lines, keep.tolist(), strict=True) if kept)
    return LogColumns(lines, time_s[keep], speed_mps[keep], grade[keep], tuple(said))


def _named(
    table: DelimitedTable, names: tuple[str, ...], units: dict[str, float]
) -> Iterator[Column]:
    """Columns of these names, in the names' order."""
    for name in names:
        for column in table.columns:
            if column.name == name or _split(column, names, units)[0] == name:
                yield column


def _split(column: Column, names: tuple[str, ...], units: dict[str, float]) -> tuple[str, str]:
    """Name and unit, which may be the last part of the name, or all of it."""
    for unit in sorted(units, key=len, reverse=True):
        if column.name == unit:
            return names[0], column.unit or unit
        if column.name.endswith(f"_{unit}"):
            return column.name.removesuffix(f"_{unit}"), column.unit or unit
    return column.name, column.unit


def _scale(
    table: DelimitedTable, column: Column, names: tuple[str, ...], units: dict[str, float]
) -> tuple[float, str]:
    name, unit = _split(column, names, units)
    if unit in units:
        return units[unit], unit
    if not unit and name in WITH_UNIT:
        return WITH_UNIT[name], ""
    known = ", ".join(units)
    if unit:
        raise InputError(
            f"{table.path}: {shown_value(column.title)}: unit {shown_value(unit)}, allowed: {known}"
        )
    example = f"{name} [{next(iter(units))}]"
    raise InputError(
        f"{table.path}: {shown_value(column.title)} names no unit: add one of {known}, as in "
        f"{shown_value(example)}"
    )


def _scaled(
    table: DelimitedTable,
    column: Column,
    names: tuple[str, ...],
    units: dict[str, float],
    said: list[str],
) -> Floats:
    scale, unit = _scale(table, column, names, units)
    if column.title not in OURS:
        how = f", in {unit}" if unit else ""
        said.append(f"{names[0]} from {shown_value(column.title)}{how}")
    return table.numbers(column, ABSENT) * scale


def _time_s(table: DelimitedTable, column: Column, said: list[str]) -> Floats:
    """Seconds, from a number with a unit, or from dates."""
    first = next((cell for cell in column.cells if cell.lower() not in ABSENT), "")
    if table.number(first) is not None:
        return _scaled(table, column, TIMES, TIME_UNITS, said)
    said.append(f"time from {shown_value(column.title)}, as dates")
    seconds = np.full(len(table.lines), np.nan)
    for k, cell in enumerate(column.cells):
        if cell.lower() in ABSENT:
            continue
        date = _date(cell)
        if date is None:
            raise InputError(
                f"{table.path}, line {table.lines[k]}: {shown_value(column.title)} is "
                f"{shown_value(cell)}, must be a number or a date, e.g. 2026-01-31T08:00:00"
            )
        seconds[k] = date.timestamp()
    return seconds


def _date(cell: str) -> datetime | None:
    """Read a date; one without a zone counts from an arbitrary one."""
    try:
        found = datetime.fromisoformat(cell)
    except ValueError:
        found = None
    for form in DATES:
        if found is None:
            try:
                found = datetime.strptime(cell, form)
            except ValueError:
                continue
    if found is not None and found.tzinfo is None:
        found = found.replace(tzinfo=UTC)
    return found
