"""The first sentences of the other reports."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_study import failing, synthetic

from qpmpc.codegen.board.report import board_answer
from qpmpc.codegen.pil.page import pil_answer
from qpmpc.report.charts import Panel, Series, numbers, over_time, run_chart
from qpmpc.report.study.answer import study_answer
from qpmpc.report.study.factor_chart import factor_charts
from qpmpc.report.study.figures import ABOVE_DP, study_table
from qpmpc.report.study.summary import study_summary
from qpmpc.verification.benchmark.charts import histogram_chart, pareto_charts
from qpmpc.verification.benchmark.pareto import Point
from qpmpc.verification.benchmark.report import benchmark_answer
from qpmpc.verification.checks import Check
from qpmpc.verification.checks.report import Results, nearest_checks, verification_answer

NO_EXCESS = {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
HOLDS = Check("Bounds", "It is below.", 1.0, 0.5)
FAILS = Check("Heat", "It is balanced.", 1.0, 2.0)
SKIPPED = Check("Emulator", "It runs.", 1.0, float("nan"), skipped=True)


@pytest.mark.parametrize(
    ("checks", "first"),
    [
        ([HOLDS], "All claims that were tested hold: 1."),
        ([HOLDS, SKIPPED], "All claims that were tested hold: 1."),
        ([HOLDS, FAILS, SKIPPED], "1 of 3 checks failed: Heat."),
        ([SKIPPED], "Nothing was tested."),
    ],
)
def test_verification(checks, first):
    said = verification_answer(Results(True, [("Group", checks)], [2.0]))
    assert said[0] == first
    assert ("Not tested on this machine: Emulator." in said) == (SKIPPED in checks)
    assert "Quick run: fewer cycles and samples." in said


def test_what_failed_comes_first_then_what_uses_most_of_its_tolerance():
    loose = Check("Loose", "It is far below.", 1.0, 0.1)
    most = Check("Share", "It is above.", 80.0, 100.0, at_least=True)  # 80 % used
    unknown = Check("Broken", "It is a number.", 1.0, float("nan"))
    exact = Check("Exact", "It is none.", 0.0, 0.0)
    groups = [("A", [loose, HOLDS, unknown]), ("B", [most, SKIPPED, FAILS, exact])]
    found = nearest_checks(Results(True, groups, [1.0]))
    assert found == [("A", unknown), ("B", FAILS), ("B", most), ("A", HOLDS), ("A", loose)]
    assert [check.share for _, check in found[1:]] == [2.0, 0.8, 0.5, 0.1]


POINTS = [
    Point("fast", "rivals", 0.1, 0.2, (0.5, 0.7), True),
    Point("broken", "rivals", 0.1, 0.3, (0.0, 0.0), False),
    Point("exact", "rivals", 1.0, 2.0, (0.1, 0.1), True),
]


def test_benchmark():
    said = benchmark_answer(POINTS, [POINTS[0], POINTS[2]], 2)
    assert said[0] == (
        "The quickest sound candidate over 2 trips is fast: worst step 0.2 ms, fuel 0.60 % above "
        "dynamic programming in the median."
    )
    assert said[1].startswith("The nearest to dynamic programming is exact: worst step 2 ms")
    assert said[2].endswith("not comparable in fuel: broken.")
    assert benchmark_answer(POINTS[1:2], [], 1)[0].startswith("No candidate drove over 1 trip")


def test_points_of_a_benchmark_are_named_and_marked():
    dp = Point("dp", "rivals", float("nan"), float("nan"), (0.0,), True)
    plane, rows = pareto_charts([*POINTS, dp], [POINTS[0], POINTS[2]])
    (panel,) = plane["panels"]
    assert panel["labels"][1] == "broken (not sound): worst step 0.3 ms, fuel 0.00 % above DP"
    assert panel["texts"] == ["fast", "", "exact"]
    front, sound, unsound = (each["values"] for each in panel["series"])
    assert front == sound == [0.6, None, 0.1]
    assert unsound == [None, 0.0, None]
    assert not panel["log"]  # there is no logarithm of zero
    assert rows["rows"] == ["fast", "broken", "exact"]
    assert rows["panels"][1]["x"] == [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]  # both trips of each
    assert pareto_charts([], []) == []


def test_a_histogram_counts_every_step():
    quick = SimpleNamespace(candidate=SimpleNamespace(label="quick"), step_ms=np.full((2, 5), 0.1))
    slow = SimpleNamespace(candidate=SimpleNamespace(label="slow"), step_ms=np.geomspace(1, 9, 50))
    chart = histogram_chart([quick, slow])
    edges = chart["x"]
    counts = [[n or 0 for n in each["values"]] for each in chart["panels"][0]["series"]]
    assert [sum(each) for each in counts] == [10, 50]
    (bin_of,) = np.flatnonzero(counts[0])
    assert edges[bin_of] <= 0.1 <= edges[bin_of + 1]
    assert len(edges) == len(counts[0])


def test_factors_have_a_dot_for_each_run_and_the_medians_of_all():
    frame, _ = synthetic(1200, vehicles=["prius-nimh"])
    table = study_table(frame).assign(terrain=["flat", "hills"] * 1800)
    (chart,) = factor_charts(table, ["vehicle", "controller"], ABOVE_DP, "set.thermal.t_amb_degc")
    (panel,) = chart["panels"]
    assert "(a dot for one of 3 runs; median and quantile of all)" in panel["label"]
    own = table[table["controller"] == "mh-qp"]
    dots, median, *_ = panel["series"]
    assert sum(value is not None for value in dots["values"]) == 400
    expected = own.groupby("set.thermal.t_amb_degc")["fuel_above_dp_percent"].median()
    found = [value for value in median["values"] if value is not None]
    assert found == pytest.approx(expected.tolist(), rel=1e-4)
    worst = own.loc[own["fuel_above_dp_percent"].idxmax()]
    assert any(text.startswith(f"run {worst['run']}, ") for text in panel["labels"])
    (by_terrain,) = factor_charts(table, ["vehicle", "controller"], ABOVE_DP, "terrain")
    assert by_terrain["rows"] == ["hills", "flat"]
    middle = by_terrain["panels"][0]["series"][1]["values"]
    expected = own.groupby("terrain")["fuel_above_dp_percent"].median()[["hills", "flat"]]
    found = [value for value in middle if value is not None]
    assert found == pytest.approx(expected.tolist(), rel=1e-4)


def test_trips_of_different_length_share_an_axis():
    chart = over_time([Panel("a", [Series("a", [1.0, 2.0], "#000000")]),
                       Panel("b", [Series("b", [1.0], "#000000")])])  # fmt: skip
    assert chart["count"] == 2
    assert chart["panels"][1]["series"][0]["values"] == [1.0, None]


def pil_row(**changes):
    times = [
        {"clock_mhz": clock, "cycles_per_instruction": cpi, "milliseconds": 1e3 * cpi / clock}
        for clock in (80, 480)
        for cpi in (1.0, 1.5, 2.5)
    ]
    row = {"algorithm": "admm", "precision": "f32", "iterations": 30, "steps": 600}
    row |= {"instructions": {"median": 900_000, "max": 1_000_000}, "on_off_flips": []}
    row |= {"milliseconds_estimated": times, "fuel_difference_percent": -0.0123}
    row |= {"violations": NO_EXCESS, "fallback_steps": 0, "fuel_above_dp_percent": 0.4}
    return row | changes


def test_processor_in_the_loop():
    first, *others = pil_answer([pil_row()])
    assert first == (
        "A step takes 1,000,000 instructions at most, an estimated 3.12 ms at 480 MHz; fuel "
        "is 0.0123 % below that of the controller in Python."
    )
    assert others == ["No limit was violated.", "No fallback drove."]
    equal = pil_answer([pil_row(fuel_difference_percent=-1e-7)])[0]
    assert "fuel equals that of the controller in Python to 0.0001 %" in equal
    bad = pil_row(violations=NO_EXCESS | {"soc": 0.01}, fallback_steps=7, on_off_flips=[3])
    assert pil_answer([bad])[1:] == [
        "Limits were violated: SOC 0.01.",
        "A fallback drove in 7 of 600 s.",
        "Engine on and off differ from Python in 1 s.",
    ]


def test_of_several_runs_in_the_loop_only_sound_ones_are_named():
    cheap = pil_row(iterations=10, instructions={"median": 1, "max": 2}, fallback_steps=1)
    good = pil_row(iterations=100, fuel_above_dp_percent=0.2)
    said = pil_answer([cheap, pil_row(instructions={"median": 3, "max": 4}), good])
    assert said[0].startswith("The cheapest step: admm f32 with 30 iterations, 4 instructions")
    assert said[1].startswith("The least fuel: admm f32 with 100 iterations")
    assert said[2] == "1 of 3 runs violated a limit or used a fallback."
    assert pil_answer([cheap, cheap]) == ["None of 2 runs kept all limits without a fallback."]


@pytest.mark.parametrize(
    ("equal", "differ", "first"),
    [
        (30, [], "All 30 commands equal this machine's to the bit."),
        (20, [], "All 30 commands agree with this machine's, 20 of them to the bit."),
        (20, [4, 5], "2 of 30 commands differ from this machine's by more than round-off."),
    ],
)
def test_board(equal, differ, first):
    data = {
        "seconds": 30,
        "unit": "cycles",
        "commands": {"equal_to_the_bit": equal, "differ_by_more": differ},
        "times": {"both": {"max": 123_456, "max_share_of_second_percent": None}},
        "fallback_seconds": 2,
    }
    said = board_answer(data)
    assert said == [first, "The longest second took 123,456 cycles.", "A fallback drove in 2 s."]


def test_a_study_names_the_runs_studied_then_what_went_wrong():
    frame, study = synthetic(20, vehicles=["prius-nimh"])
    said = study_answer(study_summary(failing(frame, [0], "broken"), study))
    assert said[0].startswith("Fuel above DP: ")
    assert "mh-qp" in said[0]
    assert "rule-based" not in said[0]
    assert "1 run failed" in said[1]
    assert study_answer(study_summary(frame.iloc[:0], replace(study, runs=3)))[0] == (
        "There is no run to report."
    )
    whole = failing(frame, range(len(frame)), "broken")
    assert "every run failed" in study_answer(study_summary(whole, study))[-1]


def test_faults_are_drawn_where_they_were_injected(runs):
    assert len(run_chart(runs)["panels"][0]["series"]) == 1
    faulted = replace(runs[1], faults={"each": [{"at_s": 10, "for_s": 5}]})
    _, fault = run_chart([runs[0], faulted])["panels"][0]["series"]
    assert [k for k, value in enumerate(fault["values"]) if value] == [10, 11, 12, 13, 14]


def test_powers_of_all_runs_have_one_scale(runs):
    first, second = run_chart(runs)["panels"][1:3]
    assert first["span"] == second["span"]
    for panel in (first, second):
        for line in panel["series"]:
            assert first["span"][0] <= min(line["values"])
            assert max(line["values"]) <= first["span"][1]


def test_what_a_chart_holds_can_be_put_into_a_page():
    assert numbers([1.234567, float("nan"), float("inf"), -0.5]) == [1.2346, None, None, -0.5]
    chart = over_time([Panel("a\x1b", [Series("b\n", [1.0, 2.0], "#000000")])])
    assert chart["panels"][0]["label"] == "a\\x1b"
    assert chart["panels"][0]["series"][0]["name"] == "b\\n"
    assert chart["count"] == 2
