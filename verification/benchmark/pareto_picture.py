"""The picture at a glance: fuel over trips against the worst step, the Pareto front marked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from qpmpc.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    log_scale,
    png,
    tidy,
)
from qpmpc.solvers.base import Floats
from qpmpc.verification.benchmark.candidates import CONTROLLERS, GENERATED
from qpmpc.verification.benchmark.pareto import Point, front, points

FAMILY_COLORS = {
    GENERATED: BLACK,
    "osqp, fixed K": VERMILION,
    "osqp, other rho": ORANGE,
    "osqp, other scaling": PURPLE,
    "paper's grid": GREEN,
    "rivals": BLUE,
    CONTROLLERS: SKY,
}
SHOWN_ABOVE_DP_PERCENT = (0.01, 50.0)
MARK = 10.0  # pixels that a mark takes
# of a name beside its point, pixels: the front goes on to the right and falls
SIDES = ((6, 9), (-6, -9), (6, -9), (-6, 9), (12, 22), (-12, -22), (12, -22), (-12, 22))


def draw_pareto(rows: Sequence[dict[str, Any]]) -> bytes:
    """Draw fuel above DP against the worst step, then both of each candidate; returns a PNG."""
    return png(pareto_figure(rows))


def pareto_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Return the figure of `draw_pareto`."""
    found = points(rows)
    best = front(found)
    trips = list(dict.fromkeys(row["cycle"] for row in rows))
    figure = Figure(figsize=(13.0, max(4.8, 1.7 + 0.2 * len(found))), layout="constrained")
    plane, times, fuel = figure.subplots(1, 3, width_ratios=(1.5, 1.0, 1.0))
    _draw_times(times, found, best)
    _draw_fuel(fuel, found)
    fuel.sharey(times)
    fuel.tick_params(labelleft=False)
    _draw_plane(plane, found, best)
    figure.suptitle(
        f"{len(trips)} {'trip' if len(trips) == 1 else 'trips'}: {_listed(trips)}. Diamonds: on "
        "the Pareto front. Hollow: a limit violated, a fallback used, or not comparable",
        fontsize=9,
    )
    families = [name for name in FAMILY_COLORS if name in {p.family for p in found}]
    dots = [Line2D([], [], color=FAMILY_COLORS[f], marker="o", linestyle="none") for f in families]
    figure.legend(dots, families, fontsize=8, frameon=False, ncols=7, loc="outside lower center")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")  # names are placed where the points are now
    _label(plane, found, best, canvas.get_renderer())  # type: ignore[no-untyped-call]
    return figure


def _listed(trips: Sequence[str]) -> str:
    few = ", ".join(trips[:4])
    return few if len(trips) <= 4 else f"{few} and {len(trips) - 4} more"


def _percent(point: Point) -> Floats:
    low, high = SHOWN_ABOVE_DP_PERCENT
    return np.asarray(np.clip(np.array(point.above_dp_percent), low, high))


def _mark(point: Point, best: Sequence[Point]) -> dict[str, Any]:
    color = FAMILY_COLORS[point.family]
    on_front = point in best
    return {
        "marker": "D" if on_front else "o",
        "markersize": 6.5 if on_front else 4.5,
        "markeredgecolor": color,
        "markerfacecolor": color if point.sound else "white",
        "linestyle": "none",
        "zorder": 3,
    }


def _draw_plane(axes: Axes, found: Sequence[Point], best: Sequence[Point]) -> None:
    for point in found:
        if np.isnan(point.worst_ms):
            continue
        color, values = FAMILY_COLORS[point.family], _percent(point)
        axes.plot(point.worst_ms, np.median(values), **_mark(point, best))
        axes.vlines(point.worst_ms, values.min(), values.max(), color=color, linewidth=0.8)
    if best:
        worst = [p.worst_ms for p in best]
        height = [float(np.median(_percent(p))) for p in best]
        axes.step(worst, height, where="post", color=GREY, linewidth=1.0, zorder=1)
    log_scale(axes, x=True, y=True)
    axes.margins(x=0.12)
    axes.set_xlabel("worst step of all trips, ms (each step's best of the repetitions)")
    axes.set_ylabel("SOC-balanced fuel above DP, %: median and range over trips")
    tidy(axes)


def _label(
    axes: Axes, found: Sequence[Point], best: Sequence[Point], renderer: RendererBase
) -> None:
    """Name the points of the front, no name over another or over a point."""
    frame = axes.get_window_extent(renderer)
    drawn = [p for p in found if np.isfinite(p.worst_ms)]
    places = np.array([(p.worst_ms, float(np.median(_percent(p)))) for p in drawn])
    taken = [
        Bbox.from_bounds(x - MARK / 2, y - MARK / 2, MARK, MARK)
        for x, y in axes.transData.transform(places)
    ]
    for point in best:
        for side in SIDES:
            text = axes.annotate(
                point.label,
                places[drawn.index(point)],
                xytext=side,
                textcoords="offset points",
                fontsize=7.5,
                ha="left" if side[0] > 0 else "right",
                va="center",
                arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkB": 3},
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
                zorder=4,
            )
            text.update_positions(renderer)
            box = Text.get_window_extent(text, renderer)  # without its line to the point
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1
            if inside and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
            text.remove()  # where no side is free, its row in the next panel names it


def _draw_times(axes: Axes, found: Sequence[Point], best: Sequence[Point]) -> None:
    for row, point in enumerate(found):
        color = FAMILY_COLORS[point.family]
        axes.hlines(row, point.median_ms, point.worst_ms, color=color, linewidth=1.0)
        axes.plot(point.median_ms, row, marker="|", markersize=7, color=color)
        axes.plot(point.worst_ms, row, **_mark(point, best))
    log_scale(axes, x=True)
    axes.set_yticks(range(len(found)), [point.label for point in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.set_xlabel("step, ms: median (bar) and worst")
    tidy(axes)
    axes.tick_params(axis="y", labelsize=7.5)
    for text, point in zip(axes.get_yticklabels(), found, strict=True):
        text.set_fontweight("bold" if point in best else "normal")


def _draw_fuel(axes: Axes, found: Sequence[Point]) -> None:
    for row, point in enumerate(found):
        color, values = FAMILY_COLORS[point.family], _percent(point)
        face = color if point.sound else "white"
        axes.hlines(row, values.min(), values.max(), color=color, linewidth=0.8)
        axes.plot(
            values,
            np.full(len(values), row),
            "o",
            markersize=3.5,
            markeredgecolor=color,
            markerfacecolor=face,
            alpha=0.7,
        )
        axes.plot(np.median(values), row, marker="|", markersize=10, color=color)
    log_scale(axes, x=True)
    axes.set_xlabel(
        "fuel above DP, %: each trip, and their median (bar)\ndrawn within {:g} and {:g}".format(
            *SHOWN_ABOVE_DP_PERCENT
        )
    )
    tidy(axes)
