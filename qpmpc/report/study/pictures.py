"""Pictures of a study: distributions of a measure, and its dependence on what varies."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from qpmpc.report.study.factors import is_numeric
from qpmpc.report.study.figures import (
    Group,
    Measure,
    distinct,
    groups_of,
    short,
    subjects,
    value_text,
)
from qpmpc.report.style import BLACK, line_style, png, tidy
from qpmpc.report.units import unit_of

if TYPE_CHECKING:
    from pandas import DataFrame

Floats = NDArray[np.float64]

WIDTH_IN, PANEL_IN = 7.5, 2.5
MOST_PANELS = 6
MOST_BOXES = 30
LONGEST = 40  # characters of a name
BINS = 40
PER_BIN = 50  # runs of a running median, at least: its p95 lies between the two worst and the next
MOST_RUNNING = 12  # points of a running median
INK = 150.0  # dots that may lie over each other before they hide the others
EDGE = 0.005  # share of the runs at either end that may lie outside a picture


def draw_distribution(table: "DataFrame", columns: Sequence[str], measure: Measure) -> bytes | None:
    """Draw histogram and empirical distribution of a measure, side by side.

    A row of panels per vehicle (and whatever else names a group), a line per controller. The axis
    fits the runs studied; how many lie beyond it is said in the picture.

    Returns
    -------
    PNG, None if there is nothing to draw
    """
    drawn = table[table[measure.key].notna()]
    studied = subjects(drawn)
    # references are zero by definition
    drawn = drawn[(drawn[measure.key] != 0.0) | drawn.index.isin(studied.index)]
    if len(drawn) == 0:
        return None
    low, high = shown_range(studied[measure.key].to_numpy(float))
    panels = panels_of(drawn, columns)
    figure = _figure(len(panels))
    grid = figure.subplots(len(panels), 2, squeeze=False, sharex=True)
    styles = styles_of(table)
    for (title, lines), (counts, shares) in zip(panels, grid, strict=True):
        for controller, part in lines:
            values = np.sort(part[measure.key].to_numpy(float))
            style = styles[controller]
            color = style["color"]
            heights, edges = np.histogram(values, BINS, (low, high))
            percent = 100.0 * heights / len(values)
            counts.stairs(percent, edges, fill=True, color=color, alpha=0.25)
            counts.stairs(percent, edges, color=color)
            label = (
                f"{short(controller, LONGEST)}, {len(values):,} runs{_beyond(values, low, high)}"
            )
            steps = 100.0 * np.arange(len(values) + 1) / len(values)
            shares.step([low, *values, max(high, values[-1])], [*steps, 100.0], where="post",
                        label=label, **style)  # fmt: skip
        counts.set_ylabel("runs, %")
        shares.set_ylabel("runs up to here, %")
        shares.set_xlim(low, high)
        shares.set_ylim(0, 101)
        counts.set_title(title, loc="left", fontsize=9, fontweight="bold")
        shares.legend(loc="lower right", fontsize=7.5, framealpha=0.8)
    for axes in grid.flat:
        tidy(axes)
    for axes in grid[-1]:
        axes.set_xlabel(measure.heading)
    return png(figure)


def draw_factor(
    table: "DataFrame", columns: Sequence[str], measure: Measure, column: str
) -> bytes | None:
    """Draw how a measure depends on one column, for the runs studied.

    Numbers: a dot per run, with running median (line) and p95, or p05 where low is bad (dashes).
    Categories: box plots, whiskers to p5 and p95; of many those with the worst medians.

    Returns
    -------
    PNG, None if there is nothing to draw
    """
    studied = subjects(table)
    drawn = studied[studied[measure.key].notna() & studied[column].notna()]
    if len(drawn) == 0:
        return None
    low, high = shown_range(drawn[measure.key].to_numpy(float))
    panels = panels_of(drawn, columns)
    numeric = is_numeric(drawn, column)
    rows = min(len(distinct(drawn, column)), MOST_BOXES)
    figure = _figure(len(panels), PANEL_IN if numeric else 0.22 * rows + 0.9)
    styles = styles_of(table)
    for (title, lines), axes in zip(panels, _column(figure, len(panels)), strict=True):
        axes.set_title(title, loc="left", fontsize=9, fontweight="bold")
        if numeric:
            for controller, part in lines:
                x, y = (part[name].to_numpy(float) for name in (column, measure.key))
                _scatter(axes, x, y, measure, controller, styles[controller])
            axes.set_ylabel(measure.heading.replace(", ", ",\n"))
            axes.set_ylim(low, high)
            axes.legend(loc="best", fontsize=7.5, framealpha=0.8)
        else:
            _boxes(axes, lines, measure, column, styles)
            axes.set_xlim(low, high)
        tidy(axes)
    axes.set_xlabel(column_text(column) if numeric else measure.heading)
    return png(figure)


def column_text(column: str) -> str:
    """Return the name of a column with its unit."""
    known = {
        "duration_s": "duration of the trip, s",
        "distance_km": "length of the trip, km",
        "mean_speed_kmh": "mean speed, stops included, km/h",
    }
    unit = unit_of(column)
    return known.get(column, column.removeprefix("set.") + (f", {unit}" if unit else ""))


def shown_range(values: Floats) -> tuple[float, float]:
    """Return the range of an axis: of all values, or without an outlying share `EDGE` of them."""
    low, high = float(values.min()), float(values.max())
    inner_low, inner_high = np.quantile(values, [EDGE, 1.0 - EDGE])
    room = max(inner_high - inner_low, 1e-9 * max(abs(inner_low), abs(inner_high)), 1e-9)
    low, high = max(low, inner_low - room), min(high, inner_high + room)
    size = max(abs(low), abs(high))
    # values that differ by rounding only are one value
    margin = 0.04 * (high - low) if high - low > 1e-6 * size else 0.05 * (size or 1.0)
    return low - margin, high + margin


def _beyond(values: Floats, low: float, high: float) -> str:
    """Say how many values an axis does not show."""
    sides = ((int((values < low).sum()), "left"), (int((values > high).sum()), "right"))
    return "".join(f", {count:,} further {side}" for count, side in sides if count)


def _figure(panels: int, panel_in: float = PANEL_IN) -> Figure:
    return Figure(figsize=(WIDTH_IN, panels * panel_in + 0.5), layout="constrained")


def _column(figure: Figure, panels: int) -> list[Axes]:
    found: list[Axes] = figure.subplots(panels, 1, squeeze=False, sharex=True)[:, 0].tolist()
    return found


def styles_of(table: "DataFrame") -> dict[str, dict[str, Any]]:
    """Return the line of each controller, as keywords of matplotlib."""
    return {name: line_style(name, i) for i, name in enumerate(distinct(table, "controller"))}


def panels_of(
    table: "DataFrame", columns: Sequence[str]
) -> list[tuple[str, list[tuple[str, "DataFrame"]]]]:
    """Split into panels: a title, and the part of each controller."""
    others = [column for column in columns if column != "controller"]
    panels = groups_of(table, others) if others else [Group({}, table)]
    found = []
    for panel in panels[:MOST_PANELS]:
        lines = [(g.names["controller"], g.table) for g in groups_of(panel.table, ["controller"])]
        found.append((short(panel.label, LONGEST), lines))
    left = len(panels) - len(found)
    if left:
        found[-1] = (f"{found[-1][0]} (not drawn: {left} more)", found[-1][1])
    return found


def _scatter(
    axes: Axes, x: Floats, y: Floats, measure: Measure, label: str, style: dict[str, Any]
) -> None:
    color = style["color"]
    alpha = float(np.clip(INK / len(x), 0.04, 0.6))
    axes.plot(x, y, "o", color=color, markersize=2.6, alpha=alpha, markeredgewidth=0.0)
    middle, curves = running(x, y, measure)
    median = curves.pop("median")
    axes.plot(middle, median, color=BLACK, linewidth=2.6)
    axes.plot(middle, median, "o-", color=color, linewidth=1.6, markersize=2.5,
              label=f"{short(label, LONGEST)}: median")  # fmt: skip
    for tail, worst in curves.items():
        axes.plot(middle, worst, color=color, linewidth=1.3, linestyle=(0, (3, 2)),
                  label=f"{short(label, LONGEST)}: {tail}")  # fmt: skip


def running(x: Floats, y: Floats, measure: Measure) -> tuple[list[float], dict[str, list[float]]]:
    """Return middles of x, over them the median of y and, of enough runs, its bad quantile."""
    order = np.argsort(x, kind="stable")
    bins = _bins(x[order])
    middle = [float(np.median(x[order][part])) for part in bins]
    curves = {"median": [float(np.median(y[order][part])) for part in bins]}
    if all(len(y[part]) >= PER_BIN for part in bins):
        tail, quantile = measure.tail
        curves[tail] = [float(np.quantile(y[order][part], quantile)) for part in bins]
    return middle, curves


def _bins(ordered: Floats) -> list[slice]:
    """Cut sorted values into parts for a running median: the values themselves if they are few."""
    edges = np.flatnonzero(np.diff(ordered)) + 1
    if len(edges) >= MOST_RUNNING:
        number = int(np.clip(len(ordered) // PER_BIN, 1, MOST_RUNNING))
        edges = np.linspace(0, len(ordered), number + 1).astype(int)[1:-1]
    ends = [0, *edges.tolist(), len(ordered)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _boxes(
    axes: Axes,
    lines: Sequence[tuple[str, "DataFrame"]],
    measure: Measure,
    column: str,
    styles: dict[str, dict[str, Any]],
) -> None:
    """Draw a row per category, with a box per controller."""
    values, count = shown_categories(lines, measure, column)
    if count > len(values):
        axes.set_ylabel(f"the {MOST_BOXES} worst of {count}")
    height = 0.8 / len(lines)
    for i, (controller, part) in enumerate(lines):
        color = styles[controller]["color"]
        samples = [part.loc[part[column] == value, measure.key].to_numpy(float) for value in values]
        places = [row + (i - (len(lines) - 1) / 2) * height for row in range(len(values))]
        axes.boxplot(
            samples, positions=places, widths=0.8 * height, orientation="horizontal", whis=(5, 95),
            patch_artist=True, boxprops={"facecolor": color, "alpha": 0.5, "edgecolor": color},
            medianprops={"color": BLACK}, whiskerprops={"color": color}, capprops={"color": color},
            flierprops={"marker": ".", "markersize": 3, "alpha": 0.3, "markeredgecolor": color},
            manage_ticks=False,
        )  # fmt: skip
        axes.plot([], [], color=color, linewidth=5, alpha=0.5, label=short(controller, LONGEST))
    axes.set_yticks(range(len(values)), [short(value_text(v), LONGEST) for v in values])
    axes.invert_yaxis()
    if len(lines) > 1:
        axes.legend(loc="best", fontsize=7.5, framealpha=0.8)


def shown_categories(
    lines: Sequence[tuple[str, "DataFrame"]], measure: Measure, column: str
) -> tuple[list[Any], int]:
    """Return the categories that are drawn, of many those with the worst medians, and how many."""
    together = [value for _, part in lines for value in distinct(part, column)]
    values = list(dict.fromkeys(together))
    if len(values) <= MOST_BOXES:
        return values, len(values)
    medians = {
        value: max(
            (-1 if measure.worse == "low" else 1)
            * float(part.loc[part[column] == value, measure.key].median())
            for _, part in lines
            if (part[column] == value).any()
        )
        for value in values
    }
    worst = sorted(values, key=lambda value: medians[value], reverse=True)
    return worst[:MOST_BOXES], len(values)
