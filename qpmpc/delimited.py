"""Tables of numbers in text files as people have them: separators, decimal commas, units."""

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.problems import shown_value

SEPARATORS = (";", "\t", ",")
COMMENT = "#"
_UNIT_IN_NAME = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*$")


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    title : as written in the header
    name : the title without a unit in brackets, in lower case, with `_` for spaces and hyphens
    unit : from brackets in the title or from a row of units, in lower case; empty where neither is
    values : shape (rows,); NaN where a cell is empty
    """

    title: str
    name: str
    unit: str
    values: NDArray[np.float64]


@dataclass(frozen=True)
class DelimitedTable:
    """A table of numbers with a header.

    Attributes
    ----------
    path : of the file
    columns : in the file's order
    lines : line of each row in the file
    """

    path: Path
    columns: tuple[Column, ...]
    lines: tuple[int, ...]


def read_delimited(path: Path, megabytes: int) -> DelimitedTable:
    """Read a table of numbers: a header, maybe a row of units, and rows.

    Values are separated by semicolons, tabs or commas, whichever the header has first in that
    order; with semicolons or tabs a decimal comma is one. Lines that begin with # and blank lines
    do not count. An empty cell is no number.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed.
    """
    lines = [
        (number, text)
        for number, text in enumerate(read_text(path, megabytes).splitlines(), start=1)
        if text.strip(" \t;,") and not text.lstrip().startswith(COMMENT)
    ]
    if len(lines) < 2:
        raise InputError(f"{path}: needs a header and at least one row below it")
    separator = next((s for s in SEPARATORS if s in lines[0][1]), ",")
    rows = [(number, _cells(path, number, text, separator)) for number, text in lines]
    header = rows[0][1]
    if len(header) != len(set(header)) or not all(header):
        raise InputError(f"{path}, line {rows[0][0]}: each column needs a name of its own")
    titles = [_named(title) for title in header]
    units = rows[1][1]
    if len(units) == len(header) and not any(map(_is_number, units)):
        titles = [
            (name, inside or below.strip("[]()").lower())
            for (name, inside), below in zip(titles, units, strict=True)
        ]
        rows = rows[1:]
    rows = rows[1:]
    if not rows:
        raise InputError(f"{path}: no rows below the header")
    values = np.array([_numbers(path, number, cells, header, separator) for number, cells in rows])
    columns = tuple(
        Column(title, name, unit, values[:, k])
        for k, (title, (name, unit)) in enumerate(zip(header, titles, strict=True))
    )
    return DelimitedTable(path, columns, tuple(number for number, _ in rows))


def _cells(path: Path, number: int, text: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader(io.StringIO(text), delimiter=separator))]
    except csv.Error:
        raise InputError(f"{path}, line {number}: not a row of a table") from None


def _named(title: str) -> tuple[str, str]:
    found = _UNIT_IN_NAME.match(title)
    name, unit = (found["name"], found["unit"]) if found else (title, "")
    return re.sub(r"[\s-]+", "_", name.strip()).lower(), unit.strip().lower()


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(
    path: Path, number: int, cells: list[str], header: list[str], separator: str
) -> list[float]:
    if len(cells) > len(header) and not any(cells[len(header) :]):
        cells = cells[: len(header)]
    if len(cells) != len(header):
        raise InputError(
            f"{path}, line {number}: {len(cells)} values, but the header has {len(header)} columns"
        )
    found = []
    for title, cell in zip(header, cells, strict=True):
        text = cell.replace(",", ".") if separator != "," else cell
        try:
            value = float(text) if text else np.nan
        except ValueError:
            value = np.inf
        if np.isinf(value) or (text and np.isnan(value)):
            raise InputError(
                f"{path}, line {number}: {shown_value(title)} is {shown_value(cell)}, must be a "
                "finite number or empty"
            )
        found.append(value)
    return found
