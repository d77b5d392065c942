"""Tables in the terminal that never lose a number to a narrow window."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from qpmpc.report.columns import Column, Row, filled


def print_rows(
    console: Console, rows: Sequence[Row], groups: Sequence[Sequence[Column]], section: str
) -> None:
    """Print rows as one table; where that is too wide, as one table a group of columns.

    Parameters
    ----------
    rows : data
    groups : columns; the first group names the row and is repeated in every table
    section : key of the rows; where its value changes, a rule is drawn

    A column without a single figure is left out.
    """
    names, *others = (filled(group, rows) for group in groups)
    whole = _table(rows, [*names, *(column for group in others for column in group)], section)
    if Measurement.get(console, console.options.update(width=10_000), whole).maximum <= (
        console.width
    ):
        console.print(whole)
        return
    for group in others:
        console.print(_table(rows, [*names, *group], section))


def _table(rows: Sequence[Row], columns: Sequence[Column], section: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, header_style="bold")
    for column in columns:
        # Names may be long and are folded, numbers never.
        table.add_column(
            column.title,
            justify="left" if column.is_name else "right",
            overflow="fold",
            no_wrap=not column.is_name,
        )
    for i, row in enumerate(rows):
        ends = i + 1 < len(rows) and rows[i + 1][section] != row[section]
        table.add_row(*(Text(column.text(row)) for column in columns), end_section=ends)
    return table
