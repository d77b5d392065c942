"""Pictures of processor-in-the-loop runs; they need matplotlib."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from qpmpc.codegen.pil.loop import PilResult
from qpmpc.report.style import BLACK, BLUE, GREY, ORANGE, SKY, VERMILION, log_scale, png, tidy

LEAST_ERROR_W = 1e-3
LINES = {
    ("admm", "f32"): (VERMILION, "-"),
    ("admm", "f64"): (ORANGE, (0, (4, 2))),
    ("osqp", "f32"): (BLUE, "-"),
    ("osqp", "f64"): (SKY, (0, (4, 2))),
}


def draw_pil(result: PilResult) -> bytes:
    """Draw instructions per step, engine power and command error over time.

    Returns
    -------
    PNG
    """
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    counts, power, error = figure.subplots(3, 1, sharex=True)
    time_s = np.arange(len(result.instructions))
    counts.plot(time_s, result.instructions / 1e6, color=BLUE, linewidth=0.9)
    counts.set_ylim(0.0, result.instructions.max() * 1.2e-6)
    counts.set_ylabel("instructions\nmillions per step")
    power.plot(time_s, result.reference_w / 1e3, color=GREY, linewidth=1.6, label="Python f64")
    power.plot(
        time_s, result.command_w / 1e3, color=VERMILION, linewidth=0.8, label=result.precision
    )
    power.set_ylabel("engine power\nkW")
    power.legend(fontsize=8, frameon=False)
    shown_w = np.maximum(result.command_error_w, LEAST_ERROR_W)
    log_scale(error, y=True)
    error.plot(time_s, shown_w, ".", color=BLACK, markersize=3)
    flips = result.flips
    if len(flips):
        label = "engine on in one, off in the other"
        error.plot(flips, shown_w[flips], "o", color=VERMILION, markersize=5, label=label)
        error.legend(fontsize=8, frameon=False)
    error.set_ylabel(f"command error\nW (at least {LEAST_ERROR_W:g} shown)")
    error.set_xlabel("time, s")
    for axes in (counts, power, error):
        tidy(axes)
    figure.suptitle(
        f"{result.run.cycle}: controller on {result.target} in QEMU, {result.precision}, "
        f"algorithm {result.algorithm}",
        fontsize=11,
    )
    return png(figure)


def draw_pareto(rows: Sequence[dict[str, Any]]) -> bytes:
    """Draw fuel above DP against instructions per step; the labels are iterations.

    Returns
    -------
    PNG
    """
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    axes = figure.subplots()
    for (algorithm, precision), (color, dashes) in LINES.items():
        chosen = [r for r in rows if (r["algorithm"], r["precision"]) == (algorithm, precision)]
        if not chosen:
            continue
        millions = [r["instructions"]["median"] / 1e6 for r in chosen]
        above = [r["fuel_above_dp_percent"] for r in chosen]
        ram_kb = chosen[0]["ram_bytes"] / 1024
        axes.plot(
            millions,
            above,
            "o",
            color=color,
            linestyle=dashes,
            markersize=5,
            linewidth=1.0,
            label=f"{algorithm} {precision}, {ram_kb:.0f} KB RAM",
        )
        if precision == "f32":
            for row, x, y in zip(chosen, millions, above, strict=True):
                axes.annotate(
                    f"K = {row['iterations']}",
                    (x, y),
                    xytext=(-4, -9),  # the curves fall, and f64 lies to the right
                    textcoords="offset points",
                    fontsize=7.5,
                    ha="right",
                )
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1)  # names are beside the points
    axes.set_xlabel("instructions per step on the Cortex-M7, millions (counted)")
    axes.set_ylabel("SOC-balanced fuel above DP, %")
    axes.set_title(f"{rows[0]['cycle']}: fuel against instructions", fontsize=10)
    axes.legend(fontsize=8, frameon=False)
    tidy(axes)
    return png(figure)
