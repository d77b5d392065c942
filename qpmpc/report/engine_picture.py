"""Picture of a measured engine: map and optimal line, fuel along it, error of its model."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.report.pwa_curves import PwaCurve
from qpmpc.report.style import BLUE, GREY, LIMIT, VERMILION, png, tidy
from qpmpc.vehicle.engine import RAD_PER_S
from qpmpc.vehicle.from_map import MappedVehicle
from qpmpc.vehicle.operating_line import torque_range


def draw_engine(mapped: MappedVehicle, fuel: PwaCurve) -> bytes:
    """Draw efficiency over speed and torque, or over power, and below the line's model.

    Returns
    -------
    PNG
    """
    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    _points(left, mapped)
    power_kw = fuel.x / 1e3
    middle.plot(power_kw, fuel.y, color=GREY, linewidth=3, label="optimal line")
    knots = fuel.fit.breakpoints
    middle.plot(
        knots / 1e3, fuel.fit(knots), "o-", color=BLUE, linewidth=1.1, markersize=3.5, label="model"
    )
    middle.set_xlabel("engine power kW")
    middle.set_ylabel("fuel g/s")
    middle.legend(frameon=False, fontsize=8)
    right.plot(power_kw, fuel.error, color=VERMILION, linewidth=1.0)
    right.axhline(fuel.fit.above, label="proven bounds", **LIMIT)
    right.axhline(-fuel.fit.below, **LIMIT)
    right.set_xlabel("engine power kW")
    right.set_ylabel("model minus line g/s")
    right.legend(frameon=False, fontsize=8)
    for axes in (left, middle, right):
        tidy(axes)
    figure.suptitle(f"Engine of {mapped.vehicle.name}", fontsize=11)
    return png(figure)


def _points(axes: Axes, mapped: MappedVehicle) -> None:
    data, line = mapped.data, mapped.line
    lhv = mapped.vehicle.engine.lhv_j_per_g
    percent = 100.0 * data.power_w / (data.fuel_g_per_s * lhv)
    if data.speed_rpm is None or data.torque_nm is None or line.speed_rpm is None:
        axes.plot(data.power_w / 1e3, percent, "o", color=GREY, markersize=3.5, label="data")
        along = 100.0 * line.power_w / (line.fuel_g_per_s * lhv)
        axes.plot(line.power_w / 1e3, along, color=BLUE, label="line")
        axes.set_xlabel("engine power kW")
        axes.set_ylabel("efficiency %")
    else:
        drawn = axes.scatter(data.speed_rpm, data.torque_nm, c=percent, s=14, cmap="viridis")
        axes.figure.colorbar(drawn, ax=axes, label="efficiency %")
        speeds, _, most_nm = torque_range(data.speed_rpm, data.torque_nm)
        axes.plot(speeds, most_nm, label="torque limit", **LIMIT)
        with np.errstate(divide="ignore", invalid="ignore"):
            torque = line.power_w / (line.speed_rpm * RAD_PER_S)
        axes.plot(line.speed_rpm, torque, color=VERMILION, linewidth=1.6, label="optimal line")
        axes.set_xlabel("engine speed rpm")
        axes.set_ylabel("torque Nm")
    axes.legend(frameon=False, fontsize=8)
