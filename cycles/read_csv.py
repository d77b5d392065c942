"""Import of a user's drive from CSV, with one clear line about any error."""

import csv
import io
import re
from array import array
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.plausibility import check_motion, check_road, check_samples
from qpmpc.cycles.suspicion import suspicions
from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.remarks import say_once

MEGABYTES_MAX = 64
"""24 h at 25 samples a second."""

REQUIRED = ("time_s", "speed_mps")
OPTIONAL = ("grade",)
ALLOWED_TEXT = "time_s,speed_mps[,grade]"

# Columns in a wrong unit: the pattern of their names, the conversion, and the right column.
CONVERSIONS = (
    (re.compile(r"km/?h|kph|kmph", re.I), "divide km/h by 3.6", "speed_mps"),
    (re.compile(r"mph|mi/h", re.I), "multiply mph by 0.44704", "speed_mps"),
    (re.compile(r"knot|kts?$", re.I), "multiply knots by 0.514444", "speed_mps"),
    (re.compile(r"grade.*(%|percent|pct)", re.I), "divide percent by 100", "grade"),
    (re.compile(r"time.*(_ms|\[ms|\(ms|milli)", re.I), "divide ms by 1000", "time_s"),
)


def read_csv(path: Path, *, name: str | None = None) -> Cycle:
    """Read ``time_s,speed_mps[,grade]`` and interpolate it linearly at whole seconds.

    Columns may come in any order, time steps may be uneven, time may start anywhere. A byte order
    mark, Windows line ends, spaces around names and blank lines at the end do not matter.

    Parameters
    ----------
    path
        UTF-8 text, values separated by commas: time in s, speed in m/s, grade as rise over run.
    name
        Name of the cycle; the stem of the file if absent.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed: unreadable file, columns other
        than the above, values that are not numbers or out of range, time that does not increase,
        a gap, a trip too short or too long, or motion that no road vehicle is capable of, as when
        speeds in km/h or mph are given as m/s (see `qpmpc.cycles.plausibility`). What is possible
        but unusual becomes a remark of the cycle (see `qpmpc.cycles.suspicion`).
    """
    lines, table = _table(path, read_text(path, MEGABYTES_MAX))
    time, speed = table["time_s"], table["speed_mps"]
    grade = table.get("grade", np.zeros(len(time)))

    check_samples(path, lines, time, speed, grade)
    cycle = Cycle.from_samples(name if name is not None else path.stem, time, speed, grade)
    check_motion(path, lines, time, cycle)
    check_road(path, cycle)
    remarks = tuple(f"{path}: {remark}" for remark in suspicions(cycle))
    for remark in remarks:
        say_once(remark)
    return replace(cycle, remarks=remarks)


def _table(path: Path, text: str) -> tuple[Sequence[int], dict[str, Floats]]:
    """Line number of each row, and its numbers by column; blank lines at the end are dropped.

    Row by row, so that a file that is no table is refused at its first line, whatever its length.
    """
    if not text.strip(" \t\r\n,"):
        raise InputError(f"{path}: the file is empty; it needs a header {ALLOWED_TEXT} and rows")
    reader = csv.reader(io.StringIO(text, newline=""))
    rows = ((reader.line_num, [cell.strip() for cell in row]) for row in reader)
    lines, numbers = array("q"), array("d")
    blank: list[tuple[int, list[str]]] = []
    try:
        columns = _columns(path, next(rows)[1])
        for line, cells in rows:
            if not any(cells):
                blank = blank or [(line, cells)]
                continue
            for first, nothing in blank:  # a blank line, but not at the end
                _numbers(path, first, nothing, columns)
            lines.append(line)
            numbers.extend(_numbers(path, line, cells, columns))
    except csv.Error:
        raise InputError(f"{path}: not a CSV file: it must be plain text in UTF-8") from None
    if len(lines) < 2:
        raise InputError(f"{path}: {len(lines)} row(s) below the header, at least 2 are needed")
    table = np.array(numbers).reshape(len(lines), len(columns))
    return lines, {column: table[:, k] for k, column in enumerate(columns)}


def _columns(path: Path, header: list[str]) -> list[str]:
    """Check the header; returns the column names in the file's order."""
    if set(REQUIRED) <= set(header) <= set(REQUIRED + OPTIONAL) and len(header) == len(set(header)):
        return header
    found = ",".join(header)
    if len(found) > 80:
        found = found[:77] + "..."
    message = f"{path}, line 1: columns found: {found!r}; allowed: {ALLOWED_TEXT}"
    hints = [
        f"{column!r}: {conversion} and name the column {target}"
        for column in header
        if column not in REQUIRED + OPTIONAL
        for pattern, conversion, target in CONVERSIONS
        if pattern.search(column)
    ]
    if len(header) == 1 and re.search(r"[;\t]", found):
        hints = ["separate columns by commas"]
    raise InputError("; ".join([message, *hints[:1]]))


def _numbers(path: Path, line: int, cells: list[str], columns: list[str]) -> list[float]:
    """Convert one row."""
    if len(cells) != len(columns):
        found = "a blank line" if not any(cells) else f"{len(cells)} value(s)"
        raise InputError(
            f"{path}, line {line}: {found}, but the header has {len(columns)} columns: "
            f"{','.join(columns)}"
        )
    numbers = []
    for column, cell in zip(columns, cells, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            shown = cell if len(cell) <= 40 else cell[:37] + "..."
            raise InputError(f"{path}, line {line}: {column} is {shown!r}, must be a finite number")
        numbers.append(number)
    return numbers
