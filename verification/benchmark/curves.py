"""Pictures of curves: error for time when stopped early, and time over the number of stages."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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

COLORS = (BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, GREY)
LEAST_ERROR_W, LEAST_ERROR_G = 1e-3, 1e-6  # drawn; below it nothing can be told apart
MOST_ERROR_W, MOST_ERROR_G = 1e5, 1e4
# key of a row, what is drawn of it, and what it is
BY_ERROR = (
    (
        "power_error_w",
        (LEAST_ERROR_W, MOST_ERROR_W),
        "engine power of the first stage, W",
    ),
    ("cost_error_g", (LEAST_ERROR_G, MOST_ERROR_G), "cost of the plan, g"),
)
GROWTH_LINES = {
    "solve_ms": "osqp: data, factorisation, K iterations",
    "update_ms": "data update in numpy",
}


def draw_anytime(rows: Sequence[dict[str, Any]]) -> bytes:
    """Draw errors of command and cost over the time of a solve that is stopped; returns a PNG."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, (key, bounds, label) in zip((left, right), BY_ERROR, strict=True):
        for name, style in zip(dict.fromkeys(row["solver"] for row in rows), curve_styles()):  # noqa: B905
            own = [row for row in rows if row["solver"] == name and row[key]]
            if own:
                times = [row["solve_time_ms"]["median"] for row in own]
                errors = np.clip([row[key]["median"] for row in own], *bounds)
                start = own[0]["start"]
                axes.plot(times, errors, label=f"{name}, {start}", markersize=4, **style)
        log_scale(axes, x=True, y=True)
        axes.set_xlabel("solve, ms (median over QPs, each the best of the repetitions)")
        axes.set_ylabel(f"median error: {label}")
        tidy(axes)
    _legend(figure, left)
    return png(figure)


def draw_growth(rows: Sequence[dict[str, Any]]) -> bytes:
    """Draw data update and solve over the number of stages; returns a PNG."""
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    axes = figure.subplots()
    stages = np.array([row["stages"] for row in rows], dtype=float)
    for (key, label), line in zip(GROWTH_LINES.items(), ("o-", "o--"), strict=True):
        times = [row[key] for row in rows]
        axes.plot(stages, times, line, color=VERMILION, label=label, linewidth=2)
    names = dict.fromkeys(name for row in rows for name in row.get("rivals_ms", {}))
    for name, style in zip(names, curve_styles()):  # noqa: B905
        found = [row.get("rivals_ms", {}).get(name) for row in rows]
        shown = [(s, t) for s, t in zip(stages, found, strict=True) if t is not None]
        if shown:
            axes.plot(*zip(*shown, strict=True), label=f"{name}, cold", markersize=4, **style)
    last = rows[-1]["solve_ms"]
    axes.plot(stages, last * stages / stages[-1], color=GREY, linewidth=0.8, ls=":", label="linear")
    log_scale(axes, x=True, y=True)
    axes.set_xlabel("stages")
    axes.set_ylabel("ms per step")
    tidy(axes)
    _legend(figure, axes)
    return png(figure)


def curve_styles() -> list[dict[str, Any]]:
    """Return the lines of solvers, in their order."""
    dashes: tuple[Any, ...] = ("-", (0, (4, 2)), (0, (1, 1)))
    return [
        {"color": color, "linestyle": dash, "marker": marker, "linewidth": 1.2}
        for dash, marker in zip(dashes, "osv", strict=True)
        for color in COLORS
    ]


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=7.5, frameon=False, loc="outside right center")
