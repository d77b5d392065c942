"""Files of a benchmark: JSON, pictures, one self-contained HTML page."""

from base64 import b64encode
from pathlib import Path

from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.html import html_page
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.benchmark.benchmark import Benchmark
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE
from qpmpc.verification.benchmark.curves import draw_anytime, draw_growth
from qpmpc.verification.benchmark.histogram import draw_histogram
from qpmpc.verification.benchmark.pareto import front, points
from qpmpc.verification.benchmark.pareto_picture import draw_pareto

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
    page = html_page(
        "qpmpc.verification.benchmark",
        "benchmark.html.j2",
        vehicle=vehicle,
        tolerance=f"{RIVAL_TOLERANCE:g}",
        front=[point.label for point in front(points(result.rows))],
        solvers=result.solvers,
        missing=result.missing,
        cycles={c: [row for row in result.rows if row["cycle"] == c] for c in cycles},
        repetitions=data["repetitions"],
        provenance=data["provenance"],
        **{name: b64encode(picture).decode() for name, picture in pictures.items()},
    )
    write_text(folder / "benchmark.html", page)
