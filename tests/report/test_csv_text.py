"""CSV of results: a spreadsheet computes none of it, a program reads every number."""

import csv
from io import StringIO

import pytest

from qpmpc.report.csv_text import csv_text


def read_back(cell: object) -> str:
    _, (found,) = csv.reader(StringIO(csv_text(["x"], [[cell]])))
    return found


@pytest.mark.parametrize(
    "text",
    ["=1+1", "+cmd|' /C calc'!A0", "-@SUM(A1)", "@SUM(A1)", "\t=1", "\N{FULLWIDTH EQUALS SIGN}1"],
)
def test_text_stays_text(text: str) -> None:
    assert read_back(text) == f"'{text}"
    assert next(csv.reader(StringIO(csv_text([text], [])))) == [f"'{text}"]


@pytest.mark.parametrize("cell", [-0.5, -3, "-0.5", "+1e-3", "-inf", "-", "nycc", "a=b", "5 - 3"])
def test_numbers_and_plain_words_stay(cell: object) -> None:
    assert read_back(cell) == str(cell)


def test_nothing_is_an_empty_cell() -> None:
    assert csv_text(["a", "b"], [[None, 1]]) == "a,b\n,1\n"
