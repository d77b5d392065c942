"""The benchmark's table in the terminal."""

from collections.abc import Sequence
from typing import Any

from qpmpc.report.table import ShownTable
from qpmpc.verification.benchmark.pareto import front, points


def benchmark_table(rows: Sequence[dict[str, Any]]) -> ShownTable:
    """Return one line per candidate and cycle; times in ms."""
    table = ShownTable(
        title="Accuracy against speed (times in ms, each step the best of its repetitions)"
    )
    table.add_column("cycle")
    table.add_column("candidate")
    for name in (
        "above DP %",
        "step median",
        "p99",
        "max",
        "solve median",
        "max",
        "own median",
        "max",
        "cycle s",
    ):
        table.add_column(name, justify="right")
    table.add_column("remark")
    best = [point.label for point in front(points(rows))]
    for row in rows:
        remarks = [f"{key} exceeded" for key, value in row["violations"].items() if value > 0]
        remarks += [f"fallback {row['fallback_steps']} s"] if row["fallback_steps"] else []
        remarks += ["Pareto front"] if row["candidate"] in best else []
        remarks += [] if row["comparable"] else ["not comparable"]
        table.add_row(
            row["cycle"],
            row["candidate"],
            f"{row['fuel_above_dp_percent']:.2f}",
            *_shown(row["step_time_ms"], "median", "p99", "max"),
            *_shown(row["solve_time_ms"], "median", "max"),
            *_shown(row["own_time_ms"], "median", "max"),
            "-" if row["cycle_time_s"] is None else f"{row['cycle_time_s']:.2f}",
            ", ".join(remarks),
        )
    return table


def solvers_table(rows: Sequence[dict[str, Any]]) -> ShownTable:
    """Return one line per rival and start, on sampled QPs; times in ms."""
    table = ShownTable(title="The same QPs, cold and warm (times in ms, each QP's best)")
    table.add_column("solver")
    table.add_column("start")
    names = ("QPs", "solved", "iterations", "solve median", "p99", "max", "own median", "p99")
    for name in (*names, "max", "cost off g", "first power off W"):
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(
            row["solver"],
            row["start"],
            str(row["qps"]),
            str(row["solved"]),
            f"{row['iterations_median']:.0f}",
            *_shown(row["solve_time_ms"], "median", "p99", "max"),
            *_shown(row["own_time_ms"], "median", "p99", "max"),
            *(f"{row[k]['max']:.2g}" if row[k] else "-" for k in ("cost_error_g", "power_error_w")),
        )
    return table


def _shown(times_ms: dict[str, float] | None, *keys: str) -> list[str]:
    return [f"{times_ms[key]:.3f}" if times_ms else "-" for key in keys]
