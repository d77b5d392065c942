"""Shared by the pictures: colours of the variants, time series with one sample per second."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.report.charts import dashes, run_chart
from qpmpc.report.style import BLACK, GREEN, LIMIT, ORANGE, line_style, tidy
from qpmpc.results import Run
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.variants import baseline

WIDTH_IN = 9.0
# one hue, three shades: the longer the horizon, the darker
BASELINES = {baseline(20): "#74C9AE", baseline(50): GREEN, baseline(100): "#00503C"}


def style(label: str) -> dict[str, Any]:
    """Line of a variant, the same in every picture."""
    if label in BASELINES:
        return {"color": BASELINES[label], "linestyle": "-", "linewidth": 1.2}
    return line_style(label)


def color(label: str) -> str:
    """Colour of a variant."""
    return str(style(label)["color"])


def look(label: str) -> dict[str, Any]:
    """Colour and dashes of a variant in a chart."""
    return {"color": color(label), "dash": dashes(style(label)["linestyle"])}


def panels(count: int, unit_in: float = 1.55, **keywords: Any) -> tuple[Figure, list[Axes]]:
    """One column of panels over one time axis."""
    figure = Figure(figsize=(WIDTH_IN, unit_in * count + 0.6), layout="constrained")
    column = figure.subplots(count, 1, sharex=True, squeeze=False, **keywords)
    return figure, column[:, 0].tolist()


def speed_panel(axes: Axes, run: Run) -> None:
    """Speed and demand of the trip."""
    speed_kmh = 3.6 * run.trajectory.speed_mps
    time_s = np.arange(len(speed_kmh)) + 0.5
    axes.fill_between(time_s, speed_kmh, color="#cccccc", edgecolor=BLACK, linewidth=0.6)
    axes.set_ylabel("speed\nkm/h")
    axes.set_ylim(bottom=0)


def state_panels(soc: Axes, coolant: Axes, study: Study, cycle: str, labels: list[str]) -> None:
    """SOC and coolant of several variants, with their limits."""
    for label in labels:
        trajectory = study.runs[cycle, label].trajectory
        soc.plot(trajectory.soc, label=label, **style(label))
        coolant.plot(trajectory.t_cl_degc, label=label, **style(label))
    soc.set_ylabel("SOC")
    coolant.set_ylabel("coolant\n°C")
    coolant.axhline(study.vehicle.thermal.t_cl_min_degc, **LIMIT)


def engine_panel(axes: Axes, run: Run, label: str) -> None:
    """Engine power of one variant as steps."""
    power_kw = run.trajectory.p_eng_w / 1e3
    axes.stairs(power_kw, np.arange(len(power_kw) + 1), fill=True, color=ORANGE)
    axes.set_ylabel("engine\nkW")
    axes.set_title(label, loc="left", fontsize=9, pad=2, fontweight="bold", color=color(label))


def finish(figure: Figure, axes: list[Axes], title: str, legend: Axes | None = None) -> Figure:
    """Tidy all panels, title above, time below, legend above one of them."""
    for each in axes:
        tidy(each)
    figure.suptitle(title, fontsize=11)
    axes[-1].set_xlabel("time, s")
    if legend is not None:
        handles, _ = legend.get_legend_handles_labels()
        legend.legend(
            ncols=min(len(handles), 7),
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            frameon=False,
            fontsize=8.5,
            borderaxespad=0.0,
        )
    figure.align_ylabels(axes)
    return figure


def chart(study: Study, cycle: str, labels: list[str]) -> dict[str, Any]:
    """Runs of several variants for the page to draw."""
    runs = [study.runs[cycle, label] for label in labels]
    return run_chart(runs, labels, lambda label, _: style(label))


def series(study: Study, cycle: str, labels: list[str]) -> dict[str, Any]:
    """Columns of time series: states one entry longer than flows."""
    first = study.runs[cycle, labels[0]].trajectory
    data: dict[str, Any] = {
        "time_s": range(len(first.soc)),
        "speed_mps": first.speed_mps.tolist(),
        "demand_w": first.demand_w.tolist(),
    }
    for label in labels:
        trajectory = study.runs[cycle, label].trajectory
        stem = label.replace(" ", "_")
        data[f"{stem} soc"] = trajectory.soc.tolist()
        data[f"{stem} t_cl_degc"] = trajectory.t_cl_degc.tolist()
        data[f"{stem} p_eng_w"] = trajectory.p_eng_w.tolist()
        data[f"{stem} engine_on"] = trajectory.engine_on.astype(int).tolist()
        data[f"{stem} fuel_g"] = trajectory.fuel_g.tolist()
    return data
