"""The plain table ``time_s,speed_mps[,grade]``: read row by row, refused at the first wrong one."""

import csv
import io
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.columns import LogColumns
from qpmpc.errors import InputError

REQUIRED = ("time_s", "speed_mps")
OPTIONAL = ("grade",)
ALLOWED_TEXT = "time_s,speed_mps[,grade]"


def is_plain(text: str) -> bool:
    """Whether it is a table of the columns of `ALLOWED_TEXT`, whose rows begin with a number."""
    first, _, rest = text.lstrip().partition("\n")
    titles = [title.strip().strip('"') for title in first.split(",")]
    cells = rest.lstrip().partition("\n")[0].split(",")
    if set(titles) - set(REQUIRED + OPTIONAL) or len(cells) != len(titles):
        return False
    try:
        float(cells[titles.index("time_s")])
    except ValueError:
        return False
    return True


def parse_plain(path: Path, text: str) -> LogColumns:
    """Parse a plain table.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed: other columns, values that are
        not finite numbers, blank lines but at the end.
    """
    lines, table = _table(path, text)
    return LogColumns(lines, table["time_s"], table["speed_mps"], table.get("grade"))


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
    raise InputError(
        f"{path}, line 1: columns found: {found!r}; a time and a speed with units are needed, "
        "as in 'Time [s],Speed [km/h]', or a speed of any name by qpmpc convert --speed-column; "
        f"allowed: {ALLOWED_TEXT}"
    )


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
