"""Tables of a comparison of two studies."""

from collections.abc import Mapping
from typing import Any

from qpmpc.report.columns import NONE
from qpmpc.report.study.figures import LIMITS, value_text
from qpmpc.report.study.markdown import interval_text, markdown_table
from qpmpc.report.study.pairs import NO_PAIRS, TITLES


def comparison_table(
    comparison: Mapping[str, Any], kind: str, digits: int = 3
) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of one kind of difference: a row per vehicle and controller."""
    names = comparison["grouped_by"]
    figures = ("mean", "median", "p05", "p95", "largest_better", "largest_worse")
    counts = ("better", "worse", "equal")
    header = [*names, "compared", *figures, *counts, "sign test p"]
    header = [text.replace("_", " ") for text in header]
    rows = []
    for group in comparison["groups"]:
        found = group["differences"][kind]
        p = found["sign_test_p"]
        row = [*(value_text(group[name]) for name in names), f"{found['n']:,}"]
        row += [interval_text(found, key, digits) for key in figures]
        row += [f"{found[key]:,}" for key in counts]
        rows.append([*row, NONE if p is None else f"{p:.2g}"])
    return header, rows


def matched_table(comparison: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of the counts: a row per vehicle and controller."""
    names = comparison["grouped_by"]
    header = [*names, "matched", "only in A", "only in B", "ambiguous"]
    header += ["failures: new, gone", *(f"{text} violated: new, gone" for text in LIMITS.values())]
    rows = []
    for group in comparison["groups"]:
        row = [value_text(group[name]) for name in names]
        row += [f"{group[key]:,}" for key in ("matched", "only_a", "only_b", "ambiguous")]
        for changed in (group["failures"], *group["violations"].values()):
            row.append(f"{changed['appeared']:,}, {changed['vanished']:,}")
        rows.append(row)
    return header, rows


def comparison_markdown(comparison: Mapping[str, Any]) -> str:
    """Return the tables of `compare_studies`, in Markdown."""
    names = len(comparison["grouped_by"])
    parts = [markdown_table(*matched_table(comparison), names)]
    for kind, title in TITLES.items():
        if any(group["differences"][kind]["n"] for group in comparison["groups"]):
            parts.append(f"{title}\n\n{markdown_table(*comparison_table(comparison, kind), names)}")
    return "\n".join(parts) if comparison["pairs"] else NO_PAIRS + "\n"
