"""The first sentences of a report: right also when something went wrong."""

import pytest

from qpmpc.report.answer import comparison_answer, difference

NO_EXCESS = {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}


def row(controller, fuel_g, cycle="nycc", **changes):
    """Of a trip that the rules drive with 100 g and the optimum with 80 g."""
    return {
        "cycle": cycle,
        "controller": controller,
        "fuel_soc_balanced_g": fuel_g,
        "saving_vs_rule_percent": 100.0 - fuel_g,
        "fuel_above_dp_percent": 100.0 * (fuel_g / 80.0 - 1.0),
        "comparable": True,
        "violations": NO_EXCESS,
        "fallback_steps": 0,
    } | changes


RULES, OPTIMUM = row("rule-based", 100.0), row("dp", 80.0)
HOT = {"violations": NO_EXCESS | {"t_cl_degc": 0.5}, "comparable": False}


def test_one_trip():
    assert comparison_answer([RULES, row("mh-qp", 82.0), OPTIMUM]) == [
        "On nycc, mh-qp burns least: 82.0 g of fuel, SOC-balanced, 18.00 % less than rule-based, "
        "2.50 % more than dp.",
        "No limit was violated.",
    ]


def test_the_price_of_dp_decides_where_there_is_one():
    cheap = row("ecms", 81.0, fuel_soc_balanced_dp_g=90.0)
    first, *_ = comparison_answer([cheap, row("mh-qp", 85.0, fuel_soc_balanced_dp_g=84.0)])
    assert first.startswith("On nycc, mh-qp burns least: 84.0 g")


def test_a_run_that_violated_a_limit_does_not_win():
    first, second = comparison_answer([RULES, row("mh-qp", 82.0), row("ecms", 79.0, **HOT)])
    assert first.startswith("On nycc, mh-qp burns least")
    assert second == "A limit was violated by ecms on nycc."


def test_a_violation_that_leaves_fuel_comparable_is_told_and_does_not_win_either():
    slight = row("ecms", 79.0, violations=NO_EXCESS | {"power_w": 1.0})
    first, second = comparison_answer([RULES, slight])
    assert first.startswith("On nycc, rule-based burns least: 100.0 g")
    assert second == "A limit was violated by ecms on nycc."


def test_no_percentage_against_a_run_that_cannot_be_compared():
    rules = RULES | {"comparable": False}
    sentences = comparison_answer([rules, row("mh-qp", 82.0), OPTIMUM])
    assert "rule-based" not in sentences[0]
    assert "2.50 % more than dp" in sentences[0]
    assert sentences[-1] == "Not comparable in fuel: rule-based on nycc."


def test_a_fallback_is_told():
    sentences = comparison_answer([RULES, row("mh-qp", 82.0, fallback_steps=3)])
    assert sentences[-1] == "A fallback drove in place of the optimiser: mh-qp on nycc (3 s)."


def test_where_nothing_can_be_compared_nobody_wins():
    first, second = comparison_answer([row("mh-qp", 82.0, **HOT), row("ecms", 83.0, **HOT)])
    assert first == "No run can be compared in fuel."
    assert second == "A limit was violated by mh-qp on nycc, ecms on nycc."
    assert comparison_answer([OPTIMUM])[0] == "No run but the optimum's can be compared in fuel."


def test_several_trips():
    other = [row("rule-based", 100.0, "udds"), row("mh-qp", 101.0, "udds")]
    rows = [RULES, row("mh-qp", 82.0), row("ecms", 90.0), *other]
    first = comparison_answer([*rows, row("ecms", 102.0, "udds")])[0]
    # each wins once: the one that did so first is named, with all its trips
    assert first == (
        "mh-qp burns least on 1 of 2 cycles, between 18.00 % less and 1.00 % more than rule-based."
    )
    rows = [row(name, 90.0 + i, f"c{j}") for j in range(3) for i, name in enumerate(("a", "b"))]
    assert comparison_answer(rows)[0] == "a burns least on all 3 cycles."


def test_a_trip_that_the_reference_did_not_drive_well_is_left_out():
    rows = [RULES, row("mh-qp", 82.0), row("mh-qp", 70.0, "udds")]
    rows.append(row("rule-based", 100.0, "udds", **HOT))
    first = comparison_answer(rows)[0]
    assert first == ("mh-qp burns least on both cycles, 18.00 % less than rule-based on 1 of them.")


def test_a_controller_alone_burns_least_of_nobody():
    assert comparison_answer([row("mh-qp", 82.0)])[0].startswith("On nycc, mh-qp burns 82.0 g")


def test_the_own_control_of_a_foreign_plant():
    plant = {"plant": {"name": "fastsim"}, "saving_vs_own_control_percent": 4.0}
    own = row("fastsim", 95.0, plant={"name": "fastsim"}, saving_vs_own_control_percent=0.0)
    first = comparison_answer([own, row("mh-qp", 91.0, **plant)])[0]
    assert "4.00 % less than fastsim" in first


def test_many_runs_are_counted():
    rows = [row("mh-qp", 82.0, f"c{i}", **HOT) for i in range(9)]
    assert comparison_answer(rows)[1].endswith("mh-qp on c5 and 3 more.")


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (-3.0, -1.0, "1.00 to 3.00 % less"),
        (1.0, 3.0, "1.00 to 3.00 % more"),
        (-1.0, 2.0, "between 1.00 % less and 2.00 % more"),
        (-2.0, -2.0, "2.00 % less"),
        (-0.001, 0.001, "0.00 % more"),
        (-1.0, 1.0, "between 1.00 % less and 1.00 % more"),
    ],
)
def test_differences_in_words(low, high, text):
    assert difference(low, high) == text
