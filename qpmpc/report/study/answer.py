"""What a study found, in sentences: its report begins with them."""

from collections.abc import Mapping
from typing import Any

from qpmpc.report.columns import number
from qpmpc.report.study.figures import LIMITS, value_text
from qpmpc.report.study.markdown import NO_RUNS
from qpmpc.results import OPTIMUM, REFERENCE

MOST_GROUPS = 4


def study_answer(summary: Mapping[str, Any]) -> list[str]:
    """Return the main figure of each group, then counts: failed, violated, not comparable."""
    measure = summary["main_measure"]
    groups = [g for g in summary["groups"] if g["measures"][measure["key"]]["n"]]
    # the references are there to be compared with, unless nothing else is
    told = [g for g in groups if g.get("controller") not in (REFERENCE, OPTIMUM)] or groups
    if not told:
        return counts_text(summary)
    parts = []
    for group in told[:MOST_GROUPS]:
        figures = group["measures"][measure["key"]]
        label = ", ".join(value_text(group[name]) for name in summary["grouped_by"])
        median, worst = (number(figures[key], measure["digits"]) for key in ("median", "worst"))
        parts.append(
            f"{label} {median} {measure['unit']} in the median and {worst} at worst of "
            f"{runs_text(figures['n'])}"
        )
    left = len(told) - len(parts)
    more = f"; {left} more groups below" if left else ""
    title = measure["title"]
    first = f"{title[0].upper()}{title[1:]}: {'; '.join(parts)}{more}."
    return [first, *counts_text(summary)]


def counts_text(summary: Mapping[str, Any]) -> list[str]:
    """Return the counts of a study in plain words."""
    counts = summary["counts"]
    done, failed, missing = counts["done"], counts["failed"], counts["missing"]
    if done + failed == 0:
        return [NO_RUNS, *([f"{missing:,} runs were planned."] if missing else [])]
    ends = "No run failed." if failed == 0 else f"{runs_text(failed)} failed, see below."
    texts = [f"{runs_text(done)} finished of {counts['planned']:,} planned. {ends}"]
    if missing:
        texts[0] += f" {runs_text(missing)} were not made: the study is not complete."
    if done == 0:
        return [*texts, "There are no figures: every run failed."]
    by_limit = ", ".join(
        f"{text} in {counts['violations'][limit]:,}"
        for limit, text in LIMITS.items()
        if counts["violations"][limit]
    )
    violated = counts["with_violation"]
    texts.append(
        (f"A limit was violated in {runs_text(violated)}: {by_limit}." if violated else
         "No limit was violated.")
        + (f" A fallback drove for a second or more in {runs_text(counts['with_fallback'])}."
           if counts["with_fallback"] else " No fallback drove.")
        + (f" {runs_text(counts['not_comparable'])} cannot be compared in fuel."
           if counts["not_comparable"] else "")
    )  # fmt: skip
    return texts


def runs_text(count: int) -> str:
    """Return a count of runs."""
    return "1 run" if count == 1 else f"{count:,} runs"
