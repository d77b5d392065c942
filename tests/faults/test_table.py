"""The tables of docs/faults.md: complete, consistent, and what the code gives."""

import re
from pathlib import Path

import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.faults.models import as_faults
from qpmpc.verification.faults import __main__ as command
from qpmpc.verification.faults.standard import standard_faults
from qpmpc.verification.faults.table import TARGET_PERCENT, measured, table

PAGE = (Path(__file__).parents[2] / "docs" / "faults.md").read_text("utf-8")
FAULTS = {as_faults([{**fault, "at_s": 0}])[0].what: fault for fault in standard_faults()}


def rows(car: str) -> dict[str, list[str]]:
    """Cells of a car's table by fault."""
    part = PAGE.split(f"### {car}\n")[1].split("###")[0].split(command.END)[0]
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in part.splitlines()
        if line.startswith("| ") and not line.startswith("| fault |")
    ]
    return {row[0]: row[1:] for row in cells}


def numbers(cell: str) -> list[float]:
    return [float(text) for text in re.findall(r"[+-]?\d+\.\d+", cell)]


@pytest.mark.parametrize("car", command.CARS)
def test_every_standard_fault_has_a_row(car):
    assert list(rows(car)) == list(FAULTS)


@pytest.mark.parametrize("car", command.CARS)
def test_bold_figures_and_counts_follow_from_the_rows(car):
    for column, (seconds, target) in zip((0, 3), TARGET_PERCENT.items(), strict=True):
        kept = 0
        for cells in rows(car).values():
            worst = max(abs(value) for value in numbers(cells[column]))
            is_bold = cells[column].startswith("**")
            kept += not is_bold
            assert worst >= target - 0.005 if is_bold else worst <= target + 0.005
        sentence = f"after {seconds} s {kept} of {len(FAULTS)} faults stay below {target:g} %"
        assert sentence in PAGE.split(f"### {car}\n")[1].split("|")[0]


@pytest.mark.slow
@pytest.mark.skipif(compiler() is None, reason="the table is of the controller in C")
@pytest.mark.parametrize(
    ("car", "what"),
    [
        ("prius-nimh", "nan of soc"),
        ("prius-nimh", "stale"),
        ("prius-liion", "solver-failure"),
        ("prius-liion", "reset"),
    ],
)
def test_rows_are_what_the_code_gives(car, what):
    """Fuel to 0.02 points, which other processors may change."""
    line = table([measured(FAULTS[what], car)]).splitlines()[-1]
    now = [cell.strip() for cell in line.strip("|").split("|")][1:]
    stated = rows(car)[what]
    for column in (0, 3):
        assert numbers(stated[column]) == pytest.approx(numbers(now[column]), abs=0.021)
    assert stated[2] == now[2]  # seconds of fallback
    assert stated[5:] == now[5:]  # what else is fallback, which drove, flags, limits


def test_the_command_refuses_a_page_without_marks(tmp_path):
    (tmp_path / "page.md").write_text("# nothing\n")
    with pytest.raises(Exception, match="no marks"):
        command.main([str(tmp_path / "page.md")])
