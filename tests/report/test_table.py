"""Tables: marks, and no number lost in a narrow window."""

import copy
from io import StringIO

import pytest
from rich.console import Console

from qpmpc.report.columns import COMPARE_COLUMNS, notes
from qpmpc.report.table import print_rows


def printed(rows, width: int) -> list[str]:
    console = Console(file=StringIO(), width=width, highlight=False)
    print_rows(console, rows, COMPARE_COLUMNS, "cycle")
    return console.file.getvalue().splitlines()


@pytest.fixture
def busy(rows):
    """Rows with everything that makes cells long."""
    busy = copy.deepcopy(rows)
    busy[1]["violations"] = {"soc": 0.0123, "t_cl_degc": 0.456, "power_w": 7890.0}
    busy[1]["comparable"] = False
    for row in busy:
        row["fuel_above_dp_percent"] = 12.3456
    return busy


@pytest.mark.parametrize("width", [80, 100, 200])
def test_every_number_is_there_whatever_the_width(busy, width):
    lines = printed(busy, width)
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    words = " ".join(lines).split()
    for row in busy:
        for column in COMPARE_COLUMNS:
            if not column.is_name:
                assert set(column.text(row).split()) <= set(words)


def test_wide_window_gets_one_table(rows):
    assert sum("controller" in line for line in printed(rows, 250)) == 1
    assert sum("controller" in line for line in printed(rows, 80)) > 1


def test_markup_in_names_is_text(rows):
    assert "[red]" in printed(rows, 250)[2]


def test_columns_without_figures_are_left_out(rows, busy):
    assert "above DP %" not in printed(rows, 250)[0]
    assert "above DP %" in printed(busy, 250)[0]


def test_run_that_is_not_comparable_is_marked_and_explained(busy):
    balanced = f"{busy[1]['fuel_soc_balanced_g']:.1f}*"
    assert balanced in " ".join(printed(busy, 250)).split()
    assert notes(busy)[0].startswith("* not comparable")
    comparable = [dict(row, comparable=True) for row in busy]
    assert "*" not in " ".join(printed(comparable, 250))
    assert notes(comparable) == []


def test_reference_that_is_not_comparable_is_mentioned(busy):
    busy[1]["comparable"] = True
    busy[0]["comparable"] = False
    assert "percentages" in notes(busy)[1]
