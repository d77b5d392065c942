"""The benchmark's table in the terminal."""

from collections.abc import Sequence
from typing import Any

from qpmpc.report.table import ShownTable


def benchmark_table(rows: Sequence[dict[str, Any]]) -> ShownTable:
    """Return one line per candidate and cycle; times in ms."""
    table = ShownTable(title="Accuracy against speed (times in ms; max: median over repetitions)")
    table.add_column("cycle")
    table.add_column("candidate")
    for name in ("above DP %", "step median", "p99", "max", "solve median", "max", "cycle s"):
        table.add_column(name, justify="right")
    table.add_column("remark")
    for row in rows:
        step, solve = row["step_time_ms"], row["solve_time_ms"]
        remarks = [f"{key} exceeded" for key, value in row["violations"].items() if value > 0]
        remarks += [f"fallback {row['fallback_steps']} s"] if row["fallback_steps"] else []
        remarks += [] if row["comparable"] else ["not comparable"]
        table.add_row(
            row["cycle"],
            row["candidate"],
            f"{row['fuel_above_dp_percent']:.2f}",
            *(f"{step[key]:.3f}" for key in ("median", "p99", "max")),
            *(f"{solve[key]:.3f}" for key in ("median", "max")),
            f"{row['cycle_time_s']:.2f}",
            ", ".join(remarks),
        )
    return table
