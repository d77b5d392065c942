"""Tables in the terminal that show every number even in a narrow window."""

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from qpmpc.report.columns import Column, Row, filled
from qpmpc.shown import shown

LONG = 40  # a cell of more characters is a sentence
NAME_WIDTH = 20  # longer names of users' files are folded


class ShownTable(Table):
    """A table whose cells and title are plain text: no markup, control characters escaped."""

    def __init__(self, title: str = "", **options: Any) -> None:
        super().__init__(title=Text(shown(title), "table.title") if title else None, **options)

    def add_row(self, *cells: Any, **options: Any) -> None:
        """Add a row; its cells are `str`."""
        super().add_row(*(Text(shown(cell)) for cell in cells), **options)


def print_rows(
    console: Console, rows: Sequence[Row], columns: Sequence[Column], section: str
) -> None:
    """Print rows as one table; where the window is too narrow, as several below each other.

    Each repeats the columns that name the row. A column without a single figure is left out.

    Parameters
    ----------
    rows : data
    columns : of the table
    section : key of the rows; where its value changes, a line is left empty
    """
    shown = filled(columns, rows)
    names = [column for column in shown if column.is_name]
    part = list(names)
    for column in shown[len(names) :]:
        if part != names and _width(console, _table(rows, [*part, column], section)) > (
            console.width
        ):
            console.print(_table(rows, part, section))
            console.print()
            part = list(names)
        part.append(column)
    console.print(_table(rows, part, section))


def print_texts(
    console: Console, header: Sequence[str], rows: Sequence[Sequence[str]], names: int = 1
) -> None:
    """Print a table of texts; its first `names` columns, and the last if it is long, are words.

    Parameters
    ----------
    header, rows : the titles, and as many cells for each row
    names : number of columns that are left-aligned
    """
    table = ShownTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i, title in enumerate(header):
        words = i < names or any(len(row[i]) > LONG for row in rows)
        table.add_column(title, justify="left" if words else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(table)


def _width(console: Console, table: Table) -> int:
    return Measurement.get(console, console.options.update(width=10_000), table).maximum


def _table(rows: Sequence[Row], columns: Sequence[Column], section: str) -> ShownTable:
    table = ShownTable(
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 1, 0, 0),
        header_style="bold",
    )
    for column in columns:
        if column.is_name:
            longest = max(len(column.title), *(len(shown(column.text(row))) for row in rows))
            table.add_column(column.title, width=min(longest, NAME_WIDTH), overflow="fold")
        else:
            table.add_column(column.title, justify="right", no_wrap=True)
    for i, row in enumerate(rows):
        ends = i + 1 < len(rows) and rows[i + 1][section] != row[section]
        table.add_row(*(column.text(row) for column in columns), end_section=ends)
    return table
