"""The plant's sanity targets on EPA's cycles."""

import pytest

from qpmpc.verification.checks.epa import CASES, TOLERANCE, main, model_mpg


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_model_reproduces_its_reference(case):
    assert model_mpg(case) == pytest.approx(case.reference_mpg, rel=TOLERANCE)


def test_the_command_shows_both_figures(capsys):
    assert main() == 0
    shown = capsys.readouterr().out
    assert "EPA" in shown
    assert "46.4" in shown
