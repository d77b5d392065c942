"""Logs in text files: columns under their own names and in their own units."""

from datetime import UTC, datetime, time
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.choose import columns_of, names_unit, scale_of
from qpmpc.cycles.logs.columns import ASSUMED, LEFT_OUT, READ, LogColumns, Said
from qpmpc.cycles.logs.quantities import (
    ELEVATION,
    GRADE,
    NOTHING_STATED,
    SPEED,
    TIME,
    LogOptions,
    Quantity,
)
from qpmpc.delimited import Column, DelimitedTable, header_names, is_absent, parse_delimited
from qpmpc.errors import InputError
from qpmpc.problems import names_shown, shown_value

OURS = ("time_s", "speed_mps", "grade", "elevation_m")  # of whose units nothing has to be said

TRIPS = ("trip", "trip_id", "tripid", "trip_no")
VEHICLES = ("vehid", "veh_id", "vehicle_id", "vehicleid")

DATES = (
    "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S", "%a %b %d %H:%M:%S GMT%z %Y",
    "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S",
)  # fmt: skip

DAY_S = 86400.0


def is_log(text: str) -> bool:
    """Whether the header of a table has a column of time and one of speed."""
    columns = [Column("", name, "", ()) for name in header_names(text)]
    return all(_is_among(columns, quantity) for quantity in (TIME, SPEED))


def parse_log(path: Path, text: str, options: LogOptions = NOTHING_STATED) -> LogColumns:
    """Parse the columns of a log.

    Raises
    ------
    InputError
        If a column names no unit or one that is not known, if speed or grade is there twice, if
        what the options state contradicts the file or has no effect, or if a value is none.
    """
    table = parse_delimited(path, text)
    chosen = {
        quantity.name: found[0] if (found := columns_of(path, table.columns, quantity, options))
        else None
        for quantity in (TIME, SPEED, GRADE, ELEVATION)
    }  # fmt: skip
    times, speeds, grades, heights = chosen.values()
    if times is None or speeds is None:
        missing = TIME if times is None else SPEED
        raise InputError(
            f"{path}: no column of {missing.name}; there are "
            f"{names_shown([column.title for column in table.columns])}"
        )
    said: list[Said] = []
    if table.titles:
        said.append(Said(LEFT_OUT, f"{table.titles} line(s) above the header not read"))
    time_s = _time_s(table, times, options, said)
    speed_mps = _scaled(table, speeds, SPEED, options, said)
    grade = _scaled(table, grades, GRADE, options, said) if grades is not None else None
    elevation_m = None
    if heights is not None and grades is not None:
        said.append(Said(LEFT_OUT, f"elevation {shown_value(heights.title)}: the grade is there"))
    elif heights is not None and not names_unit(heights, ELEVATION, options):
        said.append(
            Said(
                ASSUMED,
                f"a level road: elevation {shown_value(heights.title)} names no unit; state it "
                f"with qpmpc convert {ELEVATION.option}",
            )
        )
    elif heights is not None:
        elevation_m = _scaled(table, heights, ELEVATION, options, said)
    for quantity, column in ((GRADE, grades), (ELEVATION, heights)):
        if column is None and quantity.name in options.units:
            raise InputError(f"{path}: {quantity.option}: there is no column of {quantity.name}")
    if grades is None and heights is None:
        said.append(Said(ASSUMED, "a level road: no column of grade or elevation"))
    trips, of_trips = _trips(table)
    taken = [times, speeds, grades, heights, *of_trips]
    left = [column.title for column in table.columns if column not in taken]
    if left:
        said.append(Said(LEFT_OUT, f"not read: {names_shown(left)}"))
    log = LogColumns(table.lines, time_s, speed_mps, grade, elevation_m, trips, tuple(said))
    keep = np.isfinite(time_s) & np.isfinite(speed_mps)
    if grade is not None:
        keep &= np.isfinite(grade)
    if int(np.sum(keep)) < 2:
        raise InputError(f"{path}: {int(np.sum(keep))} row(s) with values, at least 2 are needed")
    if np.all(keep):
        return log
    absent = f"{int(np.sum(~keep))} of {len(keep)} rows without a value left out"
    return log.taken(keep, Said(LEFT_OUT, absent))


def _is_among(columns: list[Column], quantity: Quantity) -> bool:
    try:
        return bool(columns_of(Path(), columns, quantity, NOTHING_STATED))
    except InputError:  # there twice: said when it is read
        return True


def _scaled(
    table: DelimitedTable, column: Column, quantity: Quantity, options: LogOptions, said: list[Said]
) -> Floats:
    scale, unit = scale_of(table.path, column, quantity, options)
    if column.title not in OURS:
        said.append(Said(READ, f"{quantity.name} from {shown_value(column.title)}{unit}"))
    return table.numbers(column) * scale


def _trips(table: DelimitedTable) -> tuple[tuple[str, ...] | None, list[Column]]:
    """Trip of each row, and the columns that name it: with the vehicle, if there are several."""
    found = [
        next((column for column in table.columns if column.name in names), None)
        for names in (TRIPS, VEHICLES)
    ]
    trips, vehicles = found
    if trips is None:
        return None, []
    if vehicles is None or len(set(vehicles.cells)) == 1:
        return trips.cells, [trips] if vehicles is None else [trips, vehicles]
    both = zip(vehicles.cells, trips.cells, strict=True)
    return tuple(f"{vehicle}-{trip}" for vehicle, trip in both), [trips, vehicles]


def _time_s(table: DelimitedTable, column: Column, options: LogOptions, said: list[Said]) -> Floats:
    """Seconds, from a number with a unit, or from dates."""
    first = next((cell for cell in column.cells if not is_absent(cell)), "")
    if table.number(first) is not None:
        return _scaled(table, column, TIME, options, said)
    if TIME.name in options.units:
        raise InputError(
            f"{table.path}: {TIME.option}: {shown_value(column.title)} has no numbers but "
            f"{shown_value(first)}"
        )
    seconds = np.full(len(table.lines), np.nan)
    of_day = _of_day(first) is not None
    how = "times of day" if of_day else "dates"
    said.append(Said(READ, f"time from {shown_value(column.title)}, as {how}"))
    for k, cell in enumerate(column.cells):
        if is_absent(cell):
            continue
        found = _of_day(cell) if of_day else _date(cell)
        if found is None:
            raise InputError(
                f"{table.path}, line {table.lines[k]}: {shown_value(column.title)} is "
                f"{shown_value(cell)}, must be a number or a date, e.g. 2026-01-31T08:00:00"
            )
        seconds[k] = found
    if of_day:
        known = np.flatnonzero(np.isfinite(seconds))
        midnights = np.cumsum(np.diff(seconds[known], prepend=seconds[known[0]]) < -DAY_S / 2)
        seconds[known] += DAY_S * midnights
    return seconds


def _of_day(cell: str) -> float | None:
    """Seconds since midnight, from a time such as 23:59:59.5."""
    try:
        found = time.fromisoformat(cell)
    except ValueError:
        return None
    if ":" not in cell:
        return None
    return 3600.0 * found.hour + 60.0 * found.minute + found.second + 1e-6 * found.microsecond


def _date(cell: str) -> float | None:
    """Seconds of a date; one without a zone counts from an arbitrary one."""
    cell = cell.replace(",", ".")  # of the seconds
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
    return None if found is None else found.timestamp()
