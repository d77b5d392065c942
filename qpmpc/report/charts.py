"""Charts that a page draws itself, as plain data for `web/chart.js`: zoom, cursor, groups.

A chart is panels over one axis, or over rows that have names. Lines, points and bars that belong to
a group (a controller, say) are left out with it. The static picture of the same data stays in the
page, for print and without scripts.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from qpmpc.report.style import BLUE, GREY, LIMIT, ORANGE, PURPLE, line_style
from qpmpc.results import Run
from qpmpc.shown import shown

DIGITS = 5  # of a value in a page
DASHED = [6, 4]


@dataclass(frozen=True)
class Series:
    """A line, points or bars.

    Attributes
    ----------
    values : one for each value of the axis; those that are not finite leave a gap
    group : what it is left out with; empty: never
    stepped : each value holds until the next
    aside : a limit, say: shown where the scale of the others reaches, alone no reason for a panel
    points : without a line
    size : of its points, pixels; with one a line has points, and points may lie over each other
    joined : the line leaves no gap
    hollow : its points are
    bars : from 0
    """

    name: str
    values: list[float | None]
    color: str
    group: str = ""
    dash: list[int] = field(default_factory=list)
    stepped: bool = False
    fill: bool = False
    aside: bool = False
    points: bool = False
    joined: bool = False
    hollow: bool = False
    bars: bool = False
    size: int = 0

    def as_group(self) -> dict[str, Any]:
        """Return the group of this line as the page lists it, to be left out."""
        return {"name": self.group, "color": self.color, "dash": self.dash}


@dataclass(frozen=True)
class Panel:
    """Lines over each other; `label` names the quantity, with its unit.

    Attributes
    ----------
    zero : 0 is always shown
    span : least and greatest value of the scale; empty: as the lines need
    x : where its values are, if not where the chart's are; it rises
    labels : what the cursor says of each value; empty: its place on the axis
    texts : written beside the values, as far as there is room; empty for most of them
    """

    label: str
    series: list[Series]
    log: bool = False
    zero: bool = False
    span: list[float] = field(default_factory=list)
    height: int = 170
    x: list[float | None] = field(default_factory=list)
    labels: Sequence[str] = ()
    texts: Sequence[str] = ()


def over_time(panels: Sequence[Panel], groups: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """Return a chart over the seconds of a trip.

    Parameters
    ----------
    groups : name, color and dash of what can be left out
    """
    count = max(len(series.values) for panel in panels for series in panel.series)
    panels = [
        replace(panel, series=[replace(s, values=_filled(s.values, count)) for s in panel.series])
        for panel in panels
    ]
    return _chart({"count": count, "x_label": "time, s", "x_name": "s"}, panels, groups)


def lines(
    x: ArrayLike,
    label: str,
    unit: str,
    panels: Sequence[Panel],
    groups: Sequence[dict[str, Any]],
    x_log: bool = False,
) -> dict[str, Any]:
    """Return a chart over any axis; x rises."""
    axis = {"x": numbers(x), "x_label": label, "x_name": unit, "x_log": x_log}
    return _chart(axis, panels, groups)


def in_rows(
    names: Sequence[str], panels: Sequence[Panel], groups: Sequence[dict[str, Any]] = ()
) -> dict[str, Any]:
    """Return a chart of a row for each name, the first above; values go to the right.

    A panel's own `x` says in which row a value is: 0 for the first, 0.2 for a bit below its middle.
    """
    return _chart({"x": list(range(len(names))), "rows": list(names)}, panels, groups)


def only(values: Sequence[float], wanted: Sequence[bool]) -> list[float | None]:
    """Return values with a gap where they are not wanted."""
    return [value if keep else None for value, keep in zip(numbers(values), wanted, strict=True)]


def groups_of(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Return every group of the panels, in their order."""
    found: dict[str, dict[str, Any]] = {}
    for each in (series for panel in panels for series in panel.series if series.group):
        found.setdefault(each.group, each.as_group())
    return list(found.values())


def run_chart(
    runs: Sequence[Run],
    names: Sequence[str] = (),
    style_of: Callable[[str, int], dict[str, Any]] = line_style,
) -> dict[str, Any]:
    """Return speed, power split, SOC, coolant and fuel of runs on one cycle.

    Parameters
    ----------
    names : of the runs; without them those of their controllers
    style_of : matplotlib's keywords for a line, of its name and place
    """
    names = names or [run.controller for run in runs]
    first, styles = runs[0], [_line(name, style_of(name, i)) for i, name in enumerate(names)]
    speed = Series("speed", held(3.6 * first.trajectory.speed_mps), GREY, fill=True, stepped=True)
    panels = [Panel("speed, km/h", [speed, *_faults(runs)], zero=True, height=110)]
    powers = [_powers(run, style["group"]) for run, style in zip(runs, styles, strict=True)]
    span = _span(powers)
    panels += [Panel(f"{each[0].group}: power, kW", each, span=span) for each in powers]
    battery, thermal = first.vehicle.battery, first.vehicle.thermal
    states = (
        ("SOC", "soc", (battery.soc_min, battery.soc_max)),
        ("coolant, °C", "t_cl_degc", (thermal.t_cl_min_degc, thermal.t_cl_max_degc)),
    )
    for label, key, limits in states:
        lines = [
            Series(style["group"], numbers(getattr(run.trajectory, key)), **style)
            for run, style in zip(runs, styles, strict=True)
        ]
        count = len(first.trajectory.soc)
        named = zip(("least allowed", "most allowed"), limits, strict=True)
        allowed = f"{label} (allowed: {limits[0]:g} to {limits[1]:g})"
        panels.append(Panel(allowed, lines + [_limit(n, value, count) for n, value in named]))
    fuel = [
        Series(style["group"], numbers([0.0, *np.cumsum(run.trajectory.fuel_g)]), **style)
        for run, style in zip(runs, styles, strict=True)
    ]
    panels.append(Panel("fuel burnt, g", fuel, zero=True))
    return over_time(panels, [each.as_group() for each in fuel])


def numbers(values: ArrayLike) -> list[float | None]:
    """Return values with the digits that a picture shows; None for those not finite."""
    found = np.asarray(values, dtype=float)
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in found.tolist()]


def _filled(values: list[float | None], count: int) -> list[float | None]:
    """Return values with gaps at the end: trips differ in length."""
    return values + [None] * (count - len(values))


def held(values: ArrayLike) -> list[float | None]:
    """Return values of steps, the last held to the end of its second."""
    found = numbers(values)
    return [*found, *found[-1:]]


def dashes(linestyle: object) -> list[int]:
    """Return the dashes of one of matplotlib's line styles; a solid line has none."""
    return [] if linestyle == "-" else DASHED


def _line(name: str, style: dict[str, Any]) -> dict[str, Any]:
    return {"color": style["color"], "dash": dashes(style["linestyle"]), "group": name}


def _powers(run: Run, group: str) -> list[Series]:
    trajectory = run.trajectory
    return [
        Series("demand", held(trajectory.demand_w / 1e3), GREY, group, stepped=True, fill=True),
        Series("engine", held(trajectory.p_eng_w / 1e3), ORANGE, group, stepped=True, fill=True),
        Series("battery", held(trajectory.p_bat_w / 1e3), BLUE, group, stepped=True),
    ]


def _span(panels: Sequence[Sequence[Series]]) -> list[float]:
    """Scale that all panels share, with some room."""
    known = [v for panel in panels for line in panel for v in line.values if v is not None]
    low, high = min(known), max(known)
    room = 0.05 * (high - low) or 1.0
    return [low - room, high + room]


def _faults(runs: Sequence[Run]) -> list[Series]:
    """Seconds of injected faults, as high as the speed; none without any."""
    each = [fault for run in runs if run.faults for fault in run.faults["each"]]
    if not each:
        return []
    speed_kmh = 3.6 * runs[0].trajectory.speed_mps
    time_s = np.arange(len(speed_kmh))
    there = np.zeros(len(time_s), dtype=bool)
    for fault in each:
        there |= (time_s >= fault["at_s"]) & (time_s < fault["at_s"] + fault["for_s"])
    height = np.where(there, max(float(speed_kmh.max()), 1.0), 0.0)
    return [Series("injected fault", held(height), PURPLE, stepped=True, fill=True)]


def _limit(name: str, value: float, count: int) -> Series:
    return Series(name, numbers([value] * count), str(LIMIT["color"]), dash=[2, 3], aside=True)


def _chart(
    data: dict[str, Any], panels: Sequence[Panel], groups: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    panel_data = [asdict(panel) for panel in panels]
    return _plain(data | {"groups": list(groups), "panels": panel_data})


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    """Return the same with every text as pages show it: scripts put it into the page as it is."""
    return {key: _shown(value) for key, value in data.items()}


def _shown(value: Any) -> Any:
    if isinstance(value, str):
        return shown(value)
    if isinstance(value, dict):
        return _plain(value)
    return [_shown(each) for each in value] if isinstance(value, list | tuple) else value
