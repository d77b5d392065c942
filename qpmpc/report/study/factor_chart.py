"""How a study's measure depends on a column, as charts for the page to draw."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qpmpc.report.charts import Panel, Series, groups_of, in_rows, lines, numbers, only
from qpmpc.report.study.factors import is_numeric
from qpmpc.report.study.figures import Measure, short, subjects, value_text
from qpmpc.report.study.pictures import (
    LONGEST,
    column_text,
    panels_of,
    running,
    shown_categories,
    styles_of,
)

if TYPE_CHECKING:
    from pandas import DataFrame

MOST_DOTS = 500  # of a controller in a panel
DOT, MARK = 4, 9  # pixels
SPREAD = 0.3  # of the dots of a row, in rows

Parts = list[tuple[str, "DataFrame"]]


def factor_charts(
    table: "DataFrame", columns: Sequence[str], measure: Measure, column: str
) -> list[dict[str, Any]]:
    """Return what `draw_factor` draws, a dot for each run: the cursor names it.

    Of more than `MOST_DOTS` runs of a controller, every other, third ... is a dot, which is said;
    medians and quantiles are of all.
    """
    studied = subjects(table)
    drawn = studied[studied[measure.key].notna() & studied[column].notna()]
    if len(drawn) == 0:
        return []
    styles, panels = styles_of(table), panels_of(drawn, columns)
    if not is_numeric(drawn, column):
        return [_rows(title, parts, measure, column, styles) for title, parts in panels]
    made = [_panel(title, parts, measure, column, styles) for title, parts in panels]
    x = sorted({value for panel in made for value in panel.x if value is not None})
    return [lines(x, column_text(column), "", made, groups_of(made))]


def _panel(
    title: str, parts: Parts, measure: Measure, column: str, styles: dict[str, dict[str, Any]]
) -> Panel:
    """Dots, running median and the quantile at the bad side over a number."""
    marks: list[tuple[float, float, str, str]] = []  # x, y, series, what the cursor says
    known: dict[str, Series] = {}
    steps = []
    for controller, part in parts:
        name, color = short(controller, LONGEST), styles[controller]["color"]
        dots, step = _dots(part, measure)
        steps.append(step)
        known[name] = Series(name, [], color, name, points=True, size=DOT)
        marks += [
            (x, y, name, said)
            for x, y, said in zip(
                dots[column], dots[measure.key], _said(dots, measure), strict=True
            )
        ]
        x, y = (part[key].to_numpy(float) for key in (column, measure.key))
        middle, curves = running(x, y, measure)
        for key, values in curves.items():
            line = f"{name}: {key}"
            dash = [] if key == "median" else [6, 4]
            known[line] = Series(
                line, [], color, name, dash, joined=True, size=MARK if not dash else 0
            )
            marks += [
                (place, value, line, f"{line} {value:.{measure.digits}f} {measure.unit}")
                for place, value in zip(middle, values, strict=True)
            ]
    marks.sort(key=lambda mark: mark[0])
    values = [y for _, y, _, _ in marks]
    return Panel(
        f"{title}: {measure.heading}, over {column_text(column)}{_left_out(max(steps))}",
        [
            Series(**{**vars(each), "values": only(values, [key == mark[2] for mark in marks])})
            for key, each in known.items()
        ],
        height=260,
        x=numbers([x for x, _, _, _ in marks]),
        labels=[said for _, _, _, said in marks],
    )


def _rows(
    title: str, parts: Parts, measure: Measure, column: str, styles: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """A row for each category, with the runs of each controller and their median."""
    values, count = shown_categories(parts, measure, column)
    marks: list[tuple[float, float, str, str]] = []
    known: dict[str, Series] = {}
    steps = []
    for i, (controller, part) in enumerate(parts):
        name, color = short(controller, LONGEST), styles[controller]["color"]
        line, room = f"{name}: median", SPREAD / len(parts)
        known[name] = Series(name, [], color, name, points=True, size=DOT)
        known[line] = Series(line, [], color, name, points=True, hollow=True, size=MARK)
        dots, step = _dots(part, measure)
        steps.append(step)
        for row, value in enumerate(values):
            middle = row + (i - (len(parts) - 1) / 2) * 2.4 * room
            own = dots[dots[column] == value]
            places = middle + np.linspace(-room, room, len(own)) if len(own) > 1 else [middle]
            said = _said(own, measure)
            marks += [
                (float(x), y, name, text)
                for x, y, text in zip(places, own[measure.key], said, strict=False)
            ]
            all_of = part.loc[part[column] == value, measure.key]
            if len(all_of):
                median = float(all_of.median())
                text = f"{line} {median:.{measure.digits}f} {measure.unit}, {len(all_of):,} runs"
                marks.append((middle, median, line, text))
    marks.sort(key=lambda mark: mark[0])
    found = [y for _, y, _, _ in marks]
    worst = f", the {len(values)} worst of {count}" if count > len(values) else ""
    panel = Panel(
        f"{title}: {measure.heading}, by {column_text(column)}{worst}{_left_out(max(steps))}",
        [
            Series(**{**vars(each), "values": only(found, [key == mark[2] for mark in marks])})
            for key, each in known.items()
        ],
        x=numbers([x for x, _, _, _ in marks]),
        labels=[said for _, _, _, said in marks],
    )
    return in_rows([short(value_text(v), LONGEST) for v in values], [panel], groups_of([panel]))


def _dots(part: "DataFrame", measure: Measure) -> tuple["DataFrame", int]:
    """Return the runs that are drawn, the worst among them, and of how many one is."""
    step = -(-len(part) // MOST_DOTS)
    ordered = part.sort_values(measure.key, ascending=measure.worse == "low", kind="stable")
    return ordered.iloc[::step], step


def _left_out(step: int) -> str:
    return "" if step == 1 else f" (a dot for one of {step} runs; median and quantile of all)"


def _said(part: "DataFrame", measure: Measure) -> list[str]:
    return [
        f"run {run}, {short(cycle or '', LONGEST)}, {controller}: {value:.{measure.digits}f} "
        f"{measure.unit}"
        for run, cycle, controller, value in zip(
            part["run"], part["cycle"], part["controller"], part[measure.key], strict=True
        )
    ]
