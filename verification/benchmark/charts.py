"""The benchmark's pictures as charts for the page to draw."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from qpmpc.report.charts import Panel, Series, dashes, groups_of, in_rows, lines, numbers, only
from qpmpc.report.style import BLACK, GREY, VERMILION
from qpmpc.solvers.base import Floats
from qpmpc.verification.benchmark.curves import (
    BY_ERROR,
    GROWTH_LINES,
    curve_styles,
)
from qpmpc.verification.benchmark.drive import Drive
from qpmpc.verification.benchmark.histogram import COLORS, PAPER_STEP_MS
from qpmpc.verification.benchmark.pareto import Point
from qpmpc.verification.benchmark.pareto_picture import FAMILY_COLORS

BINS_A_DECADE = 20


def pareto_charts(found: Sequence[Point], best: Sequence[Point]) -> list[dict[str, Any]]:
    """Return fuel above DP against the worst step, then time and fuel of each candidate.

    Parameters
    ----------
    found : the quickest first
    best : of them, those on the front
    """
    drawn = [point for point in found if point.worst_ms > 0.0]
    return [_plane(drawn, best), _in_rows(drawn)] if drawn else []


def _plane(found: Sequence[Point], best: Sequence[Point]) -> dict[str, Any]:
    fuel = [point.fuel for point in found]
    front = Series(
        "Pareto front",
        only(fuel, [point in best for point in found]),
        GREY,
        stepped=True,
        joined=True,
        aside=True,
    )
    panel = Panel(
        "SOC-balanced fuel above DP, %: median over trips",
        [front, *_of_families(found, fuel)],
        log=min(fuel) > 0.0,
        height=420,
        labels=[
            f"{_name(p)}: worst step {p.worst_ms:.3g} ms, fuel {p.fuel:.2f} % above DP"
            for p in found
        ],
        texts=[point.label if point in best else "" for point in found],
    )
    worst = [point.worst_ms for point in found]
    return lines(worst, "worst step of all trips, ms", "ms", [panel], groups_of([panel]), True)


def _in_rows(found: Sequence[Point]) -> dict[str, Any]:
    """Worst step and fuel on each trip, a row for each candidate."""
    row, fuel = _each(found, [point.above_dp_percent for point in found])
    own = [found[i] for i in row]
    panels = [
        Panel(
            "worst step of all trips, ms",
            _of_families(found, [point.worst_ms for point in found]),
            log=True,
            labels=[
                f"{_name(p)}: median {p.median_ms:.3g}, worst {p.worst_ms:.3g} ms" for p in found
            ],
        ),
        Panel(
            "SOC-balanced fuel above DP on each trip, %",
            _of_families(own, fuel),
            x=numbers(row),
            labels=[f"{_name(p)}: {value:.2f} %" for p, value in zip(own, fuel, strict=True)],
        ),
    ]
    return in_rows([point.label for point in found], panels, groups_of(panels))


def _each(
    found: Sequence[Point], values: Sequence[Sequence[float]]
) -> tuple[list[int], list[float]]:
    """All values in one, and to which point each belongs."""
    pairs = [(i, value) for i in range(len(found)) for value in values[i]]
    return [i for i, _ in pairs], [value for _, value in pairs]


def _name(point: Point) -> str:
    return point.label + ("" if point.sound else " (not sound)")


def _of_families(found: Sequence[Point], values: Sequence[float]) -> list[Series]:
    """Points of each family, those not sound hollow."""
    return [
        Series(
            family if sound else f"{family}, not sound",
            only(values, own),
            color,
            family,
            points=True,
            hollow=not sound,
        )
        for family, color in FAMILY_COLORS.items()
        for sound in (True, False)
        if any(own := [p.family == family and p.sound == sound for p in found])
    ]


def histogram_chart(drives: Sequence[Drive]) -> dict[str, Any]:
    """Return how many steps took how long, in bins of equal ratio that all share."""
    times: list[Floats] = [drive.step_ms.ravel() for drive in drives]
    low, high = min(t.min() for t in times), max(t.max() for t in times)
    count = max(int(np.ceil(BINS_A_DECADE * np.log10(high / low))), 1)
    edges = np.geomspace(low * 0.999, high * 1.001, count + 1)
    series = []
    for drive, own, color in zip(drives, times, COLORS, strict=False):
        heights = np.histogram(own, edges)[0].astype(float)
        heights[heights == 0.0] = np.nan  # there is no logarithm of zero
        name = f"{drive.candidate.label}: median {np.median(own):.2f}, max {own.max():.2f} ms"
        own_label = drive.candidate.label
        series.append(
            Series(own_label, [*numbers(heights), None], color, name, stepped=True, fill=True)
        )
    label = f"steps by their time, the whole decision (the paper's NLP: {PAPER_STEP_MS:g} ms, mean)"
    panel = Panel(label, series, log=True, height=300)
    return lines(edges, "time of a step, ms", "from ms", [panel], groups_of([panel]), True)


def anytime_chart(rows: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Return errors of command and cost over the time after which a solver was stopped."""
    times = [row["solve_time_ms"]["median"] for row in rows]
    order = np.argsort(times, kind="stable").tolist()
    rows, times = [rows[i] for i in order], [times[i] for i in order]
    names = list(dict.fromkeys(row["solver"] for row in rows))
    panels = []
    for key, bounds, label in BY_ERROR:
        errors = [
            float(np.clip(row[key]["median"], *bounds)) if row[key] else np.nan for row in rows
        ]
        series = [
            Series(
                name,
                only(errors, [row["solver"] == name for row in rows]),
                style["color"],
                name,
                dashes(style["linestyle"]),
                joined=True,
                size=6,
            )
            for name, style in zip(names, curve_styles(), strict=False)
        ]
        said = [
            f"{row['solver']}, {row['start']}, {row['iterations']} iterations: {time:.3g} ms, "
            f"error {error:.3g} {label[-1]}"
            for row, time, error in zip(rows, times, errors, strict=True)
        ]
        panels.append(Panel(f"median error: {label}", series, log=True, height=260, labels=said))
    if not rows:
        return None
    label = "solve, ms (median over QPs, each the best of the repetitions)"
    return lines(times, label, "ms", panels, groups_of(panels), True)


def growth_chart(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return time of a step over the number of stages."""
    stages = [row["stages"] for row in rows]
    series = [
        Series(
            label,
            numbers([row[key] for row in rows]),
            VERMILION,
            label,
            dash=[] if key == "solve_ms" else [6, 4],
            joined=True,
            size=6,
        )
        for key, label in GROWTH_LINES.items()
    ]
    names = dict.fromkeys(name for row in rows for name in row.get("rivals_ms", {}))
    for name, style in zip(names, curve_styles(), strict=False):
        found = [row.get("rivals_ms", {}).get(name) for row in rows]
        if any(value is not None for value in found):
            label, dash = f"{name}, cold", dashes(style["linestyle"])
            own = numbers([np.nan if value is None else value for value in found])
            series.append(Series(label, own, style["color"], label, dash, joined=True, size=6))
    linear = rows[-1]["solve_ms"] * np.array(stages) / stages[-1]
    series.append(Series("linear", numbers(linear), BLACK, "linear", [2, 3]))
    panel = Panel("ms per step", series, log=True, height=360)
    return lines(stages, "stages", "stages", [panel], groups_of([panel]), True)
