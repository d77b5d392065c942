"""Pictures and tables of the reproduction, each with its numbers as CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import zip_longest
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from qpmpc.files import write_bytes, write_text
from qpmpc.report.csv_text import csv_text
from qpmpc.report.style import png

Cell = str | float | int | bool | None


@dataclass(frozen=True, eq=False)
class Picture:
    """A drawn figure.

    Attributes
    ----------
    name : stem of its files
    title, caption : for the report
    figure : drawn
    data : columns that it was drawn from; shorter ones are filled up with empty cells
    chart : the same for the page to draw, see `qpmpc.report.charts`; None: the picture alone
    """

    name: str
    title: str
    caption: str
    figure: Figure
    data: Mapping[str, Sequence[Any]]
    chart: dict[str, Any] | None = None

    def write(self, folder: Path) -> bytes:
        """Write PNG, SVG and CSV; returns the PNG."""
        image = png(self.figure)
        write_bytes(folder / f"{self.name}.png", image)
        write_bytes(folder / f"{self.name}.svg", _svg(self.figure))
        rows = zip_longest(*self.data.values(), fillvalue="")
        write_text(folder / f"{self.name}.csv", csv_text(list(self.data), rows))
        return image


@dataclass(frozen=True)
class Table:
    """A table; numbers are rounded in the report only.

    Attributes
    ----------
    name : stem of its file
    columns, rows : titles with units, cells
    digits : decimals of numbers, per column
    """

    name: str
    title: str
    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    digits: Sequence[int]

    def write(self, folder: Path) -> None:
        """Write CSV."""
        write_text(folder / f"{self.name}.csv", csv_text(self.columns, self.rows))

    def text(self) -> list[list[str]]:
        """Cells as the report shows them."""
        return [
            [_text(cell, digits) for cell, digits in zip(row, self.digits, strict=True)]
            for row in self.rows
        ]

    def records(self) -> list[dict[str, Cell]]:
        """Rows as plain data."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]


def _text(cell: Cell, digits: int) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    text = f"{cell:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _svg(figure: Figure) -> bytes:
    buffer = BytesIO()
    # a fixed salt and no date: equal results make equal files
    with mpl.rc_context({"svg.hashsalt": "qpmpc", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
