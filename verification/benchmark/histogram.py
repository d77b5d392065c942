"""Histogram of step times."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from qpmpc.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILION,
    log_scale,
    png,
    tidy,
)
from qpmpc.verification.benchmark.drive import Drive

PAPER_STEP_MS = 670.0
COLORS = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, GREY, BLACK)


def draw_histogram(drives: Sequence[Drive]) -> bytes:
    """Distribution of the times of all steps of some candidates; returns a PNG."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    for drive, color in zip(drives, COLORS, strict=False):
        times = drive.step_ms.ravel()
        bins = np.geomspace(times.min(), times.max() * 1.001, 60).tolist()
        axes.hist(
            times,
            bins=bins,
            histtype="step",
            color=color,
            label=f"{drive.candidate.label}: median {np.median(times):.2f}, "
            f"max {times.max():.2f} ms",
        )
    axes.axvline(PAPER_STEP_MS, color=BLACK, linewidth=0.8, linestyle=":")
    axes.annotate(
        "paper's NLP, mean", (PAPER_STEP_MS, axes.get_ylim()[1] * 0.6), fontsize=7, ha="right"
    )
    log_scale(axes, x=True, y=True)
    axes.set_xlabel("time of a step, ms (whole decision)")
    axes.set_ylabel("steps")
    axes.legend(fontsize=7, frameon=False)
    tidy(axes)
    return png(figure)
