"""Picture of runs on one cycle: speed, power split, SOC, coolant and fuel over time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.report.style import BLACK, BLUE, FAULT, LIMIT, ORANGE, line_style, png, tidy
from qpmpc.results import Run

WIDTH_IN, UNIT_IN = 9.0, 1.25
SPEED_HEIGHT, SPLIT_HEIGHT, STATE_HEIGHT = 0.7, 1.0, 1.15


def draw_trajectories(runs: Sequence[Run]) -> bytes:
    """Draw runs of one vehicle on one cycle.

    Each has a panel for its power split; SOC, coolant and fuel are drawn over each other. Injected
    faults are shaded.

    Returns
    -------
    PNG
    """
    heights = [SPEED_HEIGHT, *[SPLIT_HEIGHT] * len(runs), *[STATE_HEIGHT] * 3]
    figure = Figure(figsize=(WIDTH_IN, UNIT_IN * sum(heights) + 0.6), layout="constrained")
    column = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    panels: list[Axes] = column[:, 0].tolist()
    speed, *splits, soc, coolant, fuel = panels
    _speed(speed, runs[0])
    for i, (axes, run) in enumerate(zip(splits, runs, strict=True)):
        axes.sharey(splits[0])
        _power_split(axes, run, i)
        _states(soc, coolant, fuel, run, i)
    _limits(soc, coolant, runs[0])
    for axes in panels:
        _faults(axes, runs)
        tidy(axes)
    splits[0].legend(ncols=3, **LEGEND)
    soc.legend(ncols=len(runs), **LEGEND)
    fuel.set_xlabel("time, s")
    fuel.set_xlim(0, len(runs[0].trajectory.fuel_g))
    figure.align_ylabels(panels)
    return png(figure)


# Above its panel, at the right, where it hides nothing.
LEGEND: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 0.98),
    "frameon": False,
    "fontsize": 8.5,
    "borderaxespad": 0.0,
}


def _speed(axes: Axes, run: Run) -> None:
    speed_kmh = 3.6 * run.trajectory.speed_mps
    axes.fill_between(
        np.arange(len(speed_kmh)) + 0.5,
        speed_kmh,
        color="#cccccc",
        edgecolor=BLACK,
        linewidth=0.6,
    )
    axes.set_ylabel("speed\nkm/h")
    axes.set_ylim(bottom=0)
    axes.set_title(
        f"{run.cycle}: {run.distance_km:.2f} km, {run.vehicle.name}, "
        f"ambient {run.vehicle.thermal.t_amb_degc:g} °C",
        fontsize=11,
    )


def _power_split(axes: Axes, run: Run, index: int) -> None:
    """Demand, engine and battery; demand plus auxiliaries is engine plus battery plus brakes."""
    trajectory = run.trajectory
    edges = np.arange(len(trajectory.p_eng_w) + 1)
    axes.stairs(trajectory.demand_w / 1e3, edges, fill=True, color="#bbbbbb", label="demand")
    axes.stairs(trajectory.p_eng_w / 1e3, edges, fill=True, color=ORANGE, label="engine")
    axes.stairs(
        trajectory.p_bat_w / 1e3, edges, baseline=None, color=BLUE, linewidth=0.8, label="battery"
    )
    axes.axhline(0, color=BLACK, linewidth=0.5)
    axes.set_ylabel("power\nkW")
    axes.set_title(
        run.controller,
        loc="left",
        fontsize=9.5,
        pad=3,
        fontweight="bold",
        color=line_style(run.controller, index)["color"],
    )


def _states(soc: Axes, coolant: Axes, fuel: Axes, run: Run, index: int) -> None:
    trajectory = run.trajectory
    style = line_style(run.controller, index)
    soc.plot(trajectory.soc, label=run.controller, **style)
    coolant.plot(trajectory.t_cl_degc, **style)
    fuel.plot(np.concatenate([[0.0], np.cumsum(trajectory.fuel_g)]), **style)
    soc.set_ylabel("SOC")
    coolant.set_ylabel("coolant\n°C")
    fuel.set_ylabel("fuel burnt\ng")
    fuel.set_ylim(bottom=0)


def _faults(axes: Axes, runs: Sequence[Run]) -> None:
    """Shade the seconds of injected faults."""
    for run in runs:
        for each in run.faults["each"] if run.faults else ():
            axes.axvspan(each["at_s"], each["at_s"] + each["for_s"], **FAULT)


def _limits(soc: Axes, coolant: Axes, run: Run) -> None:
    """Draw the limits where the scale of the lines reaches them, and say them where it does not."""
    battery, thermal = run.vehicle.battery, run.vehicle.thermal
    for axes, low, high in (
        (soc, battery.soc_min, battery.soc_max),
        (coolant, thermal.t_cl_min_degc, thermal.t_cl_max_degc),
    ):
        bounds = axes.get_ylim()
        for value in (low, high):
            axes.axhline(value, **LIMIT)
        axes.set_ylim(bounds)
        quantity = axes.get_ylabel().replace("\n", ", ")
        axes.set_ylabel(f"{quantity}\nallowed {low:g} to {high:g}")
