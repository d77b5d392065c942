"""The page of a comparison of two studies, and its pictures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from qpmpc.report.columns import number
from qpmpc.report.study.figures import short, value_text
from qpmpc.report.study.page import Section, Table, chosen, page, table_of
from qpmpc.report.study.pairs import (
    ABOVE,
    CHANGES,
    EQUAL,
    FUEL,
    NO_PAIRS,
    TITLES,
)
from qpmpc.report.study.pairs_chart import pairs_charts
from qpmpc.report.study.pairs_tables import comparison_table, matched_table
from qpmpc.report.study.pictures import INK, LONGEST, shown_range
from qpmpc.report.style import BLACK, line_style, png, tidy
from qpmpc.results import OPTIMUM

DIFFERENCE_DIGITS = 3


def comparison_pictures(comparison: Mapping[str, Any]) -> dict[str, bytes]:
    """Draw run against run, and the sorted differences; PNG by name."""
    kind, sides, what, shown = shown_pairs(comparison)
    if not shown:
        return {}
    figure = Figure(figsize=(7.5, 3.6), layout="constrained")
    scatter, sorted_ = figure.subplots(1, 2)
    values = np.array([[pair[side] for side in sides] for pair in shown])
    low, high = shown_range(values.ravel())
    scatter.plot([low, high], [low, high], color=BLACK, linewidth=0.7)
    differences = np.array([pair[kind] for pair in shown])
    controllers = [pair["controller"] for pair in shown]
    for i, controller in enumerate(dict.fromkeys(controllers)):
        own = np.array([name == controller for name in controllers])
        style = line_style(controller, i)
        alpha = float(np.clip(INK / own.sum(), 0.05, 0.6))
        label = f"{short(controller, LONGEST)}, {own.sum():,} pairs"
        scatter.plot(*values[own].T, "o", color=style["color"], markersize=2.6, alpha=alpha,
                     markeredgewidth=0.0)  # fmt: skip
        percent = 100.0 * (np.arange(own.sum()) + 0.5) / own.sum()
        sorted_.plot(percent, np.sort(differences[own]), label=label, **style)
    sorted_.axhline(0.0, color=BLACK, linewidth=0.7)
    scatter.set(xlabel=f"{what}, A", ylabel=f"{what}, B", xlim=(low, high), ylim=(low, high))
    sorted_.set(
        xlabel="pairs, sorted, %",
        ylabel=TITLES[kind],
        ylim=shown_range(np.append(differences, 0.0)),
    )
    sorted_.legend(loc="best", fontsize=7.5, framealpha=0.8)
    for axes in (scatter, sorted_):
        tidy(axes)
    return {"pairs": png(figure)}


def shown_pairs(
    comparison: Mapping[str, Any],
) -> tuple[str, tuple[str, str], str, list[dict[str, Any]]]:
    """Return key of the difference, keys of A and B, what they are, and the pairs to draw."""
    pairs = comparison["pairs"]
    above = any(pair[ABOVE] is not None and pair["controller"] != OPTIMUM for pair in pairs)
    kind = ABOVE if above else FUEL
    sides = ("above_dp_a_percent", "above_dp_b_percent") if above else ("fuel_a_g", "fuel_b_g")
    shown = [
        pair
        for pair in pairs
        if pair[kind] is not None and not (above and pair["controller"] == OPTIMUM)
    ]
    # controllers that the compared settings do not reach would only stretch the axes
    changed = {pair["controller"] for pair in shown if abs(pair[kind]) > EQUAL}
    shown = [pair for pair in shown if pair["controller"] in changed] or shown
    return kind, sides, "fuel above DP, %" if above else "SOC-balanced fuel, g", shown


def comparison_page(comparison: Mapping[str, Any], pictures: Mapping[str, bytes]) -> str:
    """Return the page.

    Parameters
    ----------
    comparison : as `compare_studies` returns it
    pictures : as `comparison_pictures` returns them
    """
    a, b = comparison["a"], comparison["b"]
    names = len(comparison["grouped_by"])
    tables = [
        Table(*comparison_table(comparison, kind), names, title)
        for kind, title in TITLES.items()
        if any(group["differences"][kind]["n"] for group in comparison["groups"])
    ]
    kind, sides, what, shown = shown_pairs(comparison)
    quiet = f"A: {a['name']}, {a['runs']:,} runs. B: {b['name']}, {b['runs']:,} runs."
    sections = [
        Section(
            paragraphs=[_compared_text(comparison)],
            tables=tables,
            remarks=comparison["remarks"],
        ),
        Section(
            "Run by run",
            ["Each pair of runs, and the differences that a share of the pairs does not exceed."]
            if pictures
            else [NO_PAIRS],
            pictures=chosen(pictures, ""),
            charts={"pairs": pairs_charts(shown, kind, sides, what, TITLES[kind])} if shown else {},
        ),
        Section("What was matched", tables=[Table(*matched_table(comparison), names)]),
        _changes(comparison),
        *(
            Section(
                f"What was run: {side}, {study['name']}",
                [study["description"]] if study["description"] else [],
                [table_of(study["provenance"])] if study["provenance"] else [],
            )
            for side, study in (("A", a), ("B", b))
        ),
    ]
    return page("Two studies compared", _result_texts(comparison), quiet, sections)


def _result_texts(comparison: Mapping[str, Any]) -> list[str]:
    """Return a sentence per group that changed, and one on all others."""
    texts, same = [], []
    for group in comparison["groups"]:
        figures = group["differences"][FUEL]
        label = ", ".join(value_text(group[name]) for name in comparison["grouped_by"])
        if figures["better"] or figures["worse"]:
            texts.append(
                f"{label}: B {_against(figures['mean'])} in the mean; better in "
                f"{figures['better']:,}, worse in {figures['worse']:,} and equal in "
                f"{figures['equal']:,} of {figures['n']:,} pairs."
            )
        elif figures["n"]:
            same.append(label)
    if same:
        texts.append(f"No difference in fuel: {'; '.join(same)}.")
    if texts:
        return texts
    return ["No pair can be compared in fuel." if comparison["pairs"] else NO_PAIRS]


def _against(mean: float) -> str:
    text = number(abs(mean), DIFFERENCE_DIGITS)
    if float(text) == 0.0:
        return "burns as much as A"
    return f"burns {text} % {'less' if mean < 0.0 else 'more'} than A"


def _compared_text(comparison: Mapping[str, Any]) -> str:
    settings = "; ".join(
        f"{each['setting']}: "
        + " against ".join("default" if each[s] is None else value_text(each[s]) for s in "ab")
        for each in comparison["compared"]
    )
    return f"Settings that differ, A against B: {settings or 'none'}."


def _changes(comparison: Mapping[str, Any]) -> Section:
    title = f"The {CHANGES} largest changes"
    if not comparison["changes"]:
        return Section(title, ["No fuel changed."])
    keys = ("cycle", "vehicle", "controller", "seed")
    header = ["runs A, B", *keys, "fuel A g", "fuel B g", "B against A %"]
    rows = []
    texts = []
    for change in comparison["changes"]:
        runs = f"{change['run_a']}, {change['run_b']}"
        fuel = [number(change[key], 1) for key in ("fuel_a_g", "fuel_b_g")]
        row = [runs, *(value_text(change[key]) for key in keys), *fuel]
        rows.append([*row, number(change[FUEL], DIFFERENCE_DIGITS)])
        texts += [
            (f"{side}, run {change[f'run_{side.lower()}']}", change[f"command_{side.lower()}"])
            for side in "AB"
        ]
    return Section(title, tables=[Table(header, rows, len(keys) + 1)], texts=texts)
