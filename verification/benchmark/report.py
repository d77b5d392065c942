"""Files of a benchmark: JSON, pictures, one self-contained HTML page."""

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.answer import some
from qpmpc.report.charts import Panel, Series, numbers, scatter
from qpmpc.report.html import html_page
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.benchmark.benchmark import Benchmark
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE
from qpmpc.verification.benchmark.curves import draw_anytime, draw_growth
from qpmpc.verification.benchmark.histogram import draw_histogram
from qpmpc.verification.benchmark.pareto import Point, front, points
from qpmpc.verification.benchmark.pareto_picture import FAMILY_COLORS, draw_pareto

IN_HISTOGRAM = ("generated K=50", "osqp K=50", "piqp", "clarabel", "hpipm", "osqp paper's grid")


def write_benchmark(result: Benchmark, vehicle: Vehicle, folder: Path) -> None:
    """Write benchmark.json, the pictures and benchmark.html."""
    first = result.rows[0]["cycle"]
    shown = [d for d in result.drives if d.run.cycle == first and d.candidate.label in IN_HISTOGRAM]
    pictures = {
        "pareto": draw_pareto(result.rows),
        "histogram": draw_histogram(shown or result.drives[:1]),
        "anytime": draw_anytime(result.anytime),
        "growth": draw_growth(result.growth),
    }
    for name, picture in pictures.items():
        write_bytes(folder / f"{name}.png", picture)
    data = result.as_data()
    write_text(folder / "benchmark.json", json_text(data))
    cycles = dict.fromkeys(row["cycle"] for row in result.rows)
    found = points(result.rows)
    best = front(found)
    page = html_page(
        "qpmpc.verification.benchmark",
        "benchmark.html.j2",
        title="Accuracy against speed",
        answer=benchmark_answer(found, best, len(cycles)),
        pareto_chart=pareto_chart(found),
        vehicle=vehicle,
        tolerance=f"{RIVAL_TOLERANCE:g}",
        front=[point.label for point in best],
        solvers=result.solvers,
        missing=result.missing,
        cycles={c: [row for row in result.rows if row["cycle"] == c] for c in cycles},
        repetitions=data["repetitions"],
        provenance=data["provenance"],
        **{name: b64encode(picture).decode() for name, picture in pictures.items()},
    )
    write_text(folder / "benchmark.html", page)


def benchmark_answer(found: Sequence[Point], best: Sequence[Point], trips: int) -> list[str]:
    """Return the two ends of the Pareto front, and who is not on it for a reason."""
    over = f"over {trips} {'trip' if trips == 1 else 'trips'}"
    if not best:
        sentences = [f"No candidate drove {over} within all limits by its own means."]
    else:
        quickest, nearest = best[0], best[-1]
        sentences = [f"The quickest sound candidate {over} is {_figures(quickest)}."]
        if nearest is not quickest:
            sentences.append(f"The nearest to dynamic programming is {_figures(nearest)}.")
    unsound = [point.label for point in found if not point.sound]
    if unsound:
        sentences.append(
            "A limit violated, a fallback used, or not comparable in fuel: " + some(unsound) + "."
        )
    return sentences


def _figures(point: Point) -> str:
    return (
        f"{point.label}: worst step {point.worst_ms:.3g} ms, fuel {point.fuel:.2f} % above dynamic "
        "programming" + (" in the median" if len(point.above_dp_percent) > 1 else "")
    )


def pareto_chart(found: Sequence[Point]) -> dict[str, Any] | None:
    """Return fuel above DP against the worst step, for the page; None without a point to draw."""
    shown = [point for point in found if point.worst_ms > 0.0]
    if not shown:
        return None
    families = [name for name in FAMILY_COLORS if any(p.family == name for p in shown)]
    series = [
        Series(
            name,
            numbers([p.fuel if p.family == name else float("nan") for p in shown]),
            FAMILY_COLORS[name],
            name,
        )
        for name in families
    ]
    labels = [point.label + ("" if point.sound else " (not sound)") for point in shown]
    return scatter(
        [point.worst_ms for point in shown],
        "worst step of all trips, ms",
        Panel(
            "SOC-balanced fuel above DP, %: median over trips",
            series,
            log=min(p.fuel for p in shown) > 0.0,
            height=380,
        ),
        labels,
        [each.as_group() for each in series],
    )
