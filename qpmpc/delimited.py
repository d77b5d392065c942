"""Tables in text files as people have them: separators, decimal commas, titles, units."""

import csv
import io
import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import InputError
from qpmpc.input_text import read_table_text
from qpmpc.problems import shown_value

SEPARATORS = (";", "\t", ",")
COMMENT = "#"
ABSENT = ("", "nan", "null", "n/a")
"""What programs write where they have no value; and dashes."""

SAMPLED = 100  # lines by which the width of a table is judged
_UNIT_IN_TITLE = (
    re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$"),  # BSFC [g/(kWh)]
    re.compile(r"^(?P<name>.*?)\s*/?\s*\((?P<unit>[^()]*)\)\s*$"),  # Speed (OBD)(km/h), v / (km/h)
    re.compile(r"^(?P<name>.*\S)\s+(?:in|/)\s+(?P<unit>\S+)$"),  # v in km/h, v / km/h: DIN 1313
    re.compile(r"^(?P<name>[^,]*),\s*(?P<unit>[^,]*)$"),  # Target Speed, mph
)


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    title : as written in the header
    name : the title without its unit, in lower case, without accents, `_` for all but letters and
        digits
    unit : in brackets or after a comma, `in` or a slash in the title, or from a row of units, in
        lower case without spaces; empty where neither is
    cells : of each row, without spaces around
    """

    title: str
    name: str
    unit: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class DelimitedTable:
    """A table with a header.

    Attributes
    ----------
    path : of the file
    columns : in the file's order
    lines : line of each row in the file
    titles : how many lines above the header were left out
    decimal_comma : whether a comma in a number is its decimal point
    assumed : about the text, in a line; empty if nothing
    """

    path: Path
    columns: tuple[Column, ...]
    lines: tuple[int, ...]
    titles: int
    decimal_comma: bool
    assumed: str = ""

    def numbers(self, column: Column) -> NDArray[np.float64]:
        """Convert a column; shape (rows,), NaN where a cell says that there is no number.

        Raises
        ------
        InputError
            At the first cell that is neither a finite number nor absent.
        """
        found = np.full(len(self.lines), np.nan)
        for k, cell in enumerate(column.cells):
            if is_absent(cell):
                continue
            value = self.number(cell)
            if value is None:
                raise InputError(
                    f"{self.path}, line {self.lines[k]}: {shown_value(column.title)} is "
                    f"{shown_value(cell)}, must be a finite number or empty"
                )
            found[k] = value
        return found

    def number(self, cell: str) -> float | None:
        """Convert a cell; None if it is no finite number."""
        return _number(cell, self.decimal_comma)


def read_delimited(path: Path, megabytes: int) -> DelimitedTable:
    """Read a table from a file; see `parse_delimited`."""
    text, assumed = read_table_text(path, megabytes)
    return replace(parse_delimited(path, text), assumed=assumed)


def is_absent(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.lower() in ABSENT or not cell.strip("-")


def header_names(text: str) -> list[str]:
    """Names of the columns, as `Column.name`; empty where there is no header with rows below."""
    lines, _ = _table_lines(text)
    if len(lines) < 2:
        return []
    try:
        return [split_title(title)[0] for title in _cells(Path(), *lines[0], _separator(lines))]
    except InputError:
        return []


def parse_delimited(path: Path, text: str) -> DelimitedTable:
    """Parse a table: lines of title, a header, maybe a row of units, and rows.

    The header is the first line with two cells or more, or, where most lines have more cells than
    that one, the first which has as many and no number. They are separated by semicolons, tabs or
    commas, whichever it has first in that order; with semicolons or tabs a decimal comma is one.
    Lines that begin with # and blank lines do not count.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed.
    """
    lines, titles = _table_lines(text)
    if len(lines) < 2:
        raise InputError(f"{path}: needs a header and at least one row below it")
    separator = _separator(lines)
    rows = [(number, _cells(path, number, line, separator)) for number, line in lines]
    header = rows[0][1]
    while header and not header[-1]:
        header.pop()
    if len(header) != len(set(header)) or not all(header):
        raise InputError(f"{path}, line {rows[0][0]}: each column needs a name of its own")
    named = [split_title(title) for title in header]
    decimal_comma = separator != ","
    units = rows[1][1]
    if len(units) == len(header) and all(_is_unit(cell, decimal_comma) for cell in units):
        named = [
            (name, inside or plain_unit(below.strip("[]()")))
            for (name, inside), below in zip(named, units, strict=True)
        ]
        rows = rows[1:]
    rows = rows[1:]
    if not rows:
        raise InputError(f"{path}: no rows below the header")
    cells = [_of_width(path, number, row, len(header)) for number, row in rows]
    columns = tuple(
        Column(title, name, unit, tuple(row[k] for row in cells))
        for k, (title, (name, unit)) in enumerate(zip(header, named, strict=True))
    )
    return DelimitedTable(path, columns, tuple(number for number, _ in rows), titles, decimal_comma)


def _table_lines(text: str) -> tuple[list[tuple[int, str]], int]:
    """Lines from the header on, with their numbers, and how many of title are above it."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip(" \t;,") and not line.lstrip().startswith(COMMENT)
    ]
    first = next((k for k, (_, line) in enumerate(lines) if any(s in line for s in SEPARATORS)), 0)
    first += _titles_of_several_cells(lines[first : first + SAMPLED])
    return lines[first:], first


def _titles_of_several_cells(lines: list[tuple[int, str]]) -> int:
    """How many lines with a separator are above the header, since they are narrower than most."""
    if not lines:
        return 0
    separator = _separator(lines[-1:])
    rows = [line.rstrip(" \t;,").split(separator) for _, line in lines]
    most = Counter(map(len, rows)).most_common(1)[0][0]
    if len(rows[0]) >= most:
        return 0
    for k, row in enumerate(rows):
        if len(row) >= most and all(_number(cell, separator != ",") is None for cell in row):
            return k
    return 0


def _separator(lines: list[tuple[int, str]]) -> str:
    return next((s for s in SEPARATORS if s in lines[0][1]), ",")


def _cells(path: Path, number: int, text: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader(io.StringIO(text), delimiter=separator))]
    except csv.Error:
        raise InputError(f"{path}, line {number}: not a row of a table") from None


def _of_width(path: Path, number: int, cells: list[str], width: int) -> list[str]:
    if len(cells) > width and not any(cells[width:]):
        cells = cells[:width]
    if len(cells) != width:
        raise InputError(
            f"{path}, line {number}: {len(cells)} values, but the header has {width} columns"
        )
    return cells


def split_title(title: str) -> tuple[str, str]:
    """Return `Column.name` and the unit in the title, empty where there is none."""
    found = next((match for form in _UNIT_IN_TITLE if (match := form.match(title))), None)
    name, unit = (found["name"], found["unit"]) if found else (title, "")
    bare = re.sub("[\u0300-\u036f]", "", normalize("NFD", name.casefold()))
    return re.sub(r"[^0-9a-z%/]+", "_", bare).strip("_"), plain_unit(unit)


def plain_unit(unit: str) -> str:
    """Return a unit as in `Column.unit`."""
    return re.sub(r"[\s()]", "", unit).replace("·", "*").lower()


def _is_unit(cell: str, decimal_comma: bool) -> bool:
    """Whether a cell below the header may be a unit: short, and no number."""
    return (
        len(cell) <= 12 and _number(cell, decimal_comma) is None and not re.search(r"\d{2}", cell)
    )


def _number(cell: str, decimal_comma: bool) -> float | None:
    try:
        value = float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
