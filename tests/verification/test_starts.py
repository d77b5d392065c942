"""The QP with starts that cost something: as in the equations, and errors in it are noticed."""

from dataclasses import replace

import pytest

from qpmpc.preview import stages
from qpmpc.qp import rows, stage_qp
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.qp_checks import same_optimum, stages_agree, warm_start_shifted
from qpmpc.verification.checks.start_checks import STARTS


def failed() -> set[str]:
    """Names of the checks that fail on NYCC with 0.2 g and 4 kJ a start."""
    context = Context(True, load_vehicle("paper-nimh").with_settings(STARTS))
    checks = (stages_agree, same_optimum, warm_start_shifted)
    found = [result for check in checks for result in check(context)]
    assert len(found) == 6
    return {result.name.split(",")[0] for result in found if not result.passed}


def test_stages_and_optimum_are_those_of_the_equations() -> None:
    assert failed() == set()


@pytest.mark.parametrize(
    ("row", "old", "new"),
    [
        ("t_cl", "- per_power * lhv_j_per_g * start", "- 0.5 * per_power * lhv_j_per_g * start"),
        ("soc", "+ cranking_j", "- cranking_j"),
        ("start", "-rises * on_now", "0.0"),
        ("start", "+ rises * on_before", "+ 0.5 * rises * on_before"),
    ],
)
def test_a_wrong_row_is_noticed(monkeypatch, row, old, new) -> None:
    of_name = next(one for one in rows.ROWS if one.name == row)
    assert of_name.text.count(old) == 1
    wrong = replace(of_name, text=of_name.text.replace(old, new))
    monkeypatch.setattr(rows, "ROWS", tuple(wrong if r is of_name else r for r in rows.ROWS))
    assert failed() & {"Optimum of the QP", "Feasibility of the QP's solution"}


def test_a_wrong_price_is_noticed(monkeypatch) -> None:
    monkeypatch.setattr(rows, "COST", rows.COST.replace("start_fuel_g", "0.5 * start_fuel_g"))
    assert "Cost of the QP" in failed()


def test_a_wrong_count_is_noticed(monkeypatch) -> None:
    right = stages._cumulative_rises
    monkeypatch.setattr(stages, "_cumulative_rises", lambda *given: 1.5 * right(*given))
    assert "Stages of the horizon" in failed()


def test_cranking_without_its_loss_is_noticed(monkeypatch) -> None:
    monkeypatch.setattr(stage_qp, "cranking_j", lambda car, _: car.engine.start_energy_j)
    assert "Feasibility of the QP's solution" in failed()
