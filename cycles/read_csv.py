"""Import of a user's drive from CSV, with one clear line about any error."""

import csv
import re
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.plausibility import check_motion, check_samples
from qpmpc.errors import InputError

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
        speeds in km/h or mph are given as m/s (see `qpmpc.cycles.plausibility`).
    """
    rows = _rows(path)
    if not rows:
        raise InputError(f"{path}: the file is empty; it needs a header {ALLOWED_TEXT} and rows")
    columns = _columns(path, rows[0][1])
    if len(rows) < 3:
        raise InputError(f"{path}: {len(rows) - 1} row(s) below the header, at least 2 are needed")
    lines = [line for line, _ in rows[1:]]
    table = np.array([_numbers(path, line, cells, columns) for line, cells in rows[1:]])
    values: dict[str, Floats] = {column: table[:, k] for k, column in enumerate(columns)}
    grade = values.get("grade", np.zeros(len(table)))

    check_samples(path, lines, values["time_s"], values["speed_mps"], grade)
    cycle = Cycle.from_samples(
        name if name is not None else path.stem, values["time_s"], values["speed_mps"], grade
    )
    check_motion(path, lines, values["time_s"], cycle)
    return cycle


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and stripped cells of each row, without the blank ones at the end."""
    try:
        # "utf-8-sig" drops a byte order mark
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory, not a CSV file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path}: not a CSV file: it must be plain text in UTF-8") from None
    if any("\0" in cell for _, cells in rows for cell in cells):
        raise InputError(f"{path}: not a CSV file: it must be plain text in UTF-8")
    while rows and not any(rows[-1][1]):
        rows.pop()
    return rows


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
