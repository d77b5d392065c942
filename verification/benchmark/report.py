"""Files of a benchmark: JSON, pictures, one self-contained HTML page."""

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path

from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.answer import some
from qpmpc.report.html import html_page
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.benchmark.benchmark import Benchmark
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE
from qpmpc.verification.benchmark.charts import (
    anytime_chart,
    growth_chart,
    histogram_chart,
    pareto_charts,
)
from qpmpc.verification.benchmark.curves import draw_anytime, draw_growth
from qpmpc.verification.benchmark.histogram import draw_histogram
from qpmpc.verification.benchmark.pareto import Point, front, points
from qpmpc.verification.benchmark.pareto_picture import draw_pareto

IN_HISTOGRAM = ("generated K=50", "osqp K=50", "piqp", "clarabel", "hpipm", "osqp paper's grid")


def write_benchmark(result: Benchmark, vehicle: Vehicle, folder: Path) -> None:
    """Write benchmark.json, the pictures and benchmark.html."""
    first = result.rows[0]["cycle"]
    shown = [d for d in result.drives if d.run.cycle == first and d.candidate.label in IN_HISTOGRAM]
    shown = shown or result.drives[:1]
    pictures = {
        "pareto": draw_pareto(result.rows),
        "histogram": draw_histogram(shown),
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
        charts={
            "pareto": pareto_charts(found, best),
            "histogram": histogram_chart(shown),
            "anytime": anytime_chart(result.anytime),
            "growth": growth_chart(result.growth),
        },
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
