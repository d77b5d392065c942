"""Pictures of the benchmark: Pareto front, histogram of step times, growth over stages."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from qpmpc.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, png, tidy
from qpmpc.verification.benchmark.drive import Drive

FAMILY_COLORS = {
    "generated C, fixed K": BLACK,
    "osqp, fixed K": VERMILION,
    "osqp, other rho": ORANGE,
    "osqp, other scaling": PURPLE,
    "paper's grid": GREEN,
    "rivals": BLUE,
}
PAPER_STEP_MS = 670.0
SHOWN_ABOVE_DP_PERCENT = (0.05, 30.0)


def draw_pareto(rows: Sequence[dict[str, Any]]) -> bytes:
    """Fuel above DP against the worst step, one panel per cycle; returns a PNG."""
    cycles = list(dict.fromkeys(row["cycle"] for row in rows))
    figure = Figure(figsize=(5.4 * len(cycles), 4.6), layout="constrained")
    panels = figure.subplots(1, len(cycles), sharey=True, squeeze=False)[0]
    for axes, cycle in zip(panels, cycles, strict=True):
        for family, color in FAMILY_COLORS.items():
            chosen = [r for r in rows if r["cycle"] == cycle and r["family"] == family]
            if not chosen:
                continue
            worst = [r["step_time_ms"]["max"] for r in chosen]
            above = np.clip([r["fuel_above_dp_percent"] for r in chosen], *SHOWN_ABOVE_DP_PERCENT)
            axes.plot(
                worst,
                above,
                "o-" if family.endswith("fixed K") else "o",
                color=color,
                markersize=5,
                linewidth=0.8,
                label=family,
            )
            for row, x, y in zip(chosen, worst, above, strict=True):
                short = row["candidate"].removeprefix("osqp").removeprefix("generated").lstrip(", ")
                axes.annotate(
                    short, (x, y), xytext=(4, 3), textcoords="offset points", fontsize=6.5
                )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(cycle, fontsize=10)
        axes.set_xlabel("worst step, ms (whole decision, median of runs)")
        tidy(axes)
    panels[0].set_ylabel("SOC-balanced fuel above DP, %")
    panels[-1].legend(fontsize=7, frameon=False)
    return png(figure)


def draw_histogram(drives: Sequence[Drive]) -> bytes:
    """Distribution of the times of all steps of some candidates; returns a PNG."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    colors = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, GREY, BLACK)
    for drive, color in zip(drives, colors, strict=False):
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
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time of a step, ms (whole decision)")
    axes.set_ylabel("steps")
    axes.legend(fontsize=7, frameon=False)
    tidy(axes)
    return png(figure)


def draw_growth(rows: Sequence[dict[str, Any]]) -> bytes:
    """Data update and solve over the number of stages; returns a PNG."""
    figure = Figure(figsize=(6.0, 3.8), layout="constrained")
    axes = figure.subplots()
    stages = np.array([row["stages"] for row in rows], dtype=float)
    for key, color, label in (
        ("solve_ms", VERMILION, "OSQP: data, factorisation, K iterations"),
        ("update_ms", BLUE, "data update in numpy"),
    ):
        axes.plot(stages, [row[key] for row in rows], "o-", color=color, label=label)
    last = rows[-1]["solve_ms"]
    axes.plot(stages, last * stages / stages[-1], color=GREY, linewidth=0.8, ls=":", label="linear")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("stages")
    axes.set_ylabel("ms per step")
    axes.legend(fontsize=8, frameon=False)
    tidy(axes)
    return png(figure)
