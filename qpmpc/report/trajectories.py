"""Picture of runs on one cycle: speed, powers, SOC, coolant and fuel over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.report.style import BLACK, LIMIT, line_style, png, tidy
from qpmpc.results import Run

PANELS = (
    # title, height
    ("speed", 0.7),
    ("demand", 0.9),
    ("engine", 1.1),
    ("battery", 1.1),
    ("soc", 1.0),
    ("coolant", 1.0),
    ("fuel", 1.0),
)


def draw_trajectories(runs: Sequence[Run]) -> bytes:
    """Draw runs of one vehicle on one cycle over each other.

    Returns
    -------
    PNG
    """
    heights = [height for _, height in PANELS]
    figure = Figure(figsize=(9.0, 1.35 * sum(heights) + 0.9), layout="constrained")
    grid = figure.add_gridspec(len(PANELS), 1, height_ratios=heights)
    first = figure.add_subplot(grid[0])
    panels = [first, *(figure.add_subplot(grid[i], sharex=first) for i in range(1, len(PANELS)))]
    speed, demand, engine, battery, soc, coolant, fuel = panels
    _road(speed, demand, runs[0])
    for i, run in enumerate(runs):
        _states(soc, coolant, fuel, run, i)
        _powers(engine, battery, run, i)
    _limits(soc, coolant, runs[0])
    for axes in panels:
        tidy(axes)
        axes.tick_params(labelbottom=axes is fuel)
    figure.align_ylabels(panels)
    fuel.set_xlabel("time, s")
    steps = len(runs[0].trajectory.fuel_g)
    fuel.set_xlim(0, steps)
    handles, labels = soc.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=min(len(labels), 5),
        frameon=False,
        fontsize=9,
    )
    figure.suptitle(_title(runs[0]), fontsize=11)
    return png(figure)


def _title(run: Run) -> str:
    thermal = run.vehicle.thermal
    return (
        f"{run.cycle}, {run.distance_km:.2f} km, {run.vehicle.name}, ambient "
        f"{thermal.t_amb_degc:g} °C"
    )


def _road(speed: Axes, demand: Axes, run: Run) -> None:
    trajectory = run.trajectory
    time = np.arange(len(trajectory.speed_mps) + 1)
    speed.fill_between(
        time[:-1] + 0.5, trajectory.speed_mps * 3.6, color="#cccccc", edgecolor=BLACK, linewidth=0.6
    )
    speed.set_ylabel("speed\nkm/h")
    speed.set_ylim(bottom=0)
    demand.stairs(trajectory.demand_w / 1e3, time, color=BLACK, linewidth=0.8, baseline=None)
    demand.axhline(0, color=BLACK, linewidth=0.5)
    demand.set_ylabel("demand\nkW")


def _powers(engine: Axes, battery: Axes, run: Run, index: int) -> None:
    trajectory = run.trajectory
    edges = np.arange(len(trajectory.p_eng_w) + 1)
    style = line_style(run.controller, index) | {"linewidth": 0.9}
    engine.stairs(trajectory.p_eng_w / 1e3, edges, baseline=None, **style)
    battery.stairs(trajectory.p_bat_w / 1e3, edges, baseline=None, **style)
    engine.set_ylabel("engine\nkW")
    battery.set_ylabel("battery\nkW")
    battery.axhline(0, color=BLACK, linewidth=0.5)


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


def _limits(soc: Axes, coolant: Axes, run: Run) -> None:
    battery, thermal = run.vehicle.battery, run.vehicle.thermal
    soc.axhline(battery.soc_min, label="limits", **LIMIT)
    soc.axhline(battery.soc_max, **LIMIT)
    coolant.axhline(thermal.t_cl_min_degc, **LIMIT)
    coolant.axhline(thermal.t_cl_max_degc, **LIMIT)
