"""Tables of a study, in Markdown for the docs."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from qpmpc.report.columns import NONE, number
from qpmpc.report.study.figures import value_text
from qpmpc.shown import shown

NO_RUNS = "There is no run to report."


def interval_text(figures: Mapping[str, Any], key: str, digits: int) -> str:
    """Return a figure with its confidence interval, where it has one."""
    text = number(figures[key], digits)
    interval = figures.get(f"{key}_ci")
    if interval is None:
        return text
    low, high = (number(end, digits) for end in interval)
    return f"{text} [{low}, {high}]"


def headline(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return the headings and the cells of the main table: a row per vehicle and controller."""
    measure, names = summary["main_measure"], summary["grouped_by"]
    digits, tail = measure["digits"], measure["tail"]
    saved = any(g["measures"]["saving_vs_rule_percent"]["n"] for g in summary["groups"])
    header = [*names, f"median {measure['unit']}", tail, "worst", "mean", "compared"]
    header += ["with a violation", "failed", *(["worse than the rules"] if saved else [])]
    rows = []
    for group in summary["groups"]:
        figures, saving = (
            group["measures"][key] for key in (measure["key"], "saving_vs_rule_percent")
        )
        row = [*(value_text(group[name]) for name in names)]
        row += [interval_text(figures, key, digits) for key in ("median", tail, "worst", "mean")]
        row += [f"{figures['n']:,} of {group['runs']:,}"]
        row += [f"{group['with_violation']:,}", f"{group['failed']:,}"]
        if saved:
            row.append(f"{group['worse_than_rules']:,} of {saving['n']:,}" if saving["n"] else NONE)
        rows.append(row)
    return header, rows


def summary_markdown(summary: Mapping[str, Any]) -> str:
    """Return the main table of `study_summary`, with a line above it that says what it shows."""
    if not summary["groups"]:
        return NO_RUNS + "\n"
    measure = summary["main_measure"]
    header, rows = headline(summary)
    title = f"{measure['title']}, {measure['unit']}, with 95 % confidence intervals:"
    title = title[0].upper() + title[1:]
    return f"{title}\n\n{markdown_table(header, rows, len(summary['grouped_by']))}"


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], names: int) -> str:
    """Return a table; its first `names` columns are left-aligned, the others right."""
    rule = ["---"] * names + ["---:"] * (len(header) - names)
    cells = [[*map(_escaped, row[:names]), *row[names:]] for row in rows]
    lines = [[_escaped(text) for text in header], rule, *cells]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _escaped(text: str) -> str:
    """Return a name that is neither markup nor HTML."""
    return re.sub(r"([\\`*_{}<>#|~$&\[\]])", r"\\\1", shown(text))
