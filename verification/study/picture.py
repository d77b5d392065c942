"""Picture of the study: mean and largest fuel above DP of every variant, by setting."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from qpmpc.report.style import BLACK, BLUE, GREY, VERMILION, png, tidy

SHOWN_PERCENT = 3.0  # larger values are drawn at the edge, with their number


def draw_study(rows: Sequence[dict[str, Any]]) -> bytes:
    """Return a PNG: one line per variant, mean as a dot, maximum as the end of its bar."""
    figure = Figure(figsize=(7.5, 0.24 * len(rows) + 1.2), layout="constrained")
    axes = figure.subplots()
    default = rows[0]["mean_percent"]
    for i, row in enumerate(rows):
        color = VERMILION if row["violated"] else BLUE
        most = min(row["max_percent"], SHOWN_PERCENT)
        mean = min(row["mean_percent"], SHOWN_PERCENT)
        axes.plot([mean, most], [i, i], color=color, linewidth=1.2)
        axes.plot([mean], [i], "o", color=color, markersize=4)
        if row["max_percent"] > SHOWN_PERCENT:
            axes.annotate(
                f"max {row['max_percent']:.1f}", (most, i), fontsize=7, va="center", ha="left"
            )
    axes.axvline(default, color=GREY, linewidth=0.8, linestyle=":")
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_yticks(range(len(rows)), [f"{row['group']}: {row['label']}" for row in rows])
    axes.invert_yaxis()
    axes.set_xlim(0.0, SHOWN_PERCENT * 1.1)
    axes.set_xlabel("SOC-balanced fuel above DP, %: mean (dot) and maximum; red: a limit violated")
    tidy(axes)
    return png(figure)
