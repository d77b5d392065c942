"""The main tables of a study, and of a comparison of two, in the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from qpmpc.report.study.markdown import NO_RUNS, headline
from qpmpc.report.study.pairs import FUEL
from qpmpc.report.study.pairs_tables import comparison_table
from qpmpc.report.table import print_texts


def print_study(console: Console, summary: Mapping[str, Any]) -> None:
    """Print what `study_summary` found: one row per vehicle and controller, then its remarks."""
    if not summary["groups"]:
        console.print(NO_RUNS)
        return
    measure = summary["main_measure"]
    console.print(f"{summary['study']['name']}: {measure['title']}, {measure['unit']}")
    print_texts(console, *headline(summary), names=len(summary["grouped_by"]))
    for remark in summary["remarks"]:
        console.print(remark)


def print_comparison(console: Console, comparison: Mapping[str, Any]) -> None:
    """Print what `compare_studies` found: one row per vehicle and controller, then its remarks."""
    print_texts(console, *comparison_table(comparison, FUEL))
    for remark in comparison["remarks"]:
        console.print(remark)
