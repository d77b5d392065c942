"""The quick grid against the reference, on given cycles with given cars.

``python -m qpmpc.verification.dynamic_programming.quick_error [CYCLE ...] [--json FILE]`` prints a
Markdown table. Nothing is taken from the cache: the times are those of solving, on one thread.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

from rich.console import Console
from rich.progress import Progress

from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.errors import QpmpcError
from qpmpc.files import check_file, json_text, write_text
from qpmpc.pool import in_order
from qpmpc.shown import shown
from qpmpc.vehicle import load_vehicle, vehicle_names
from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solve_dp import solve_dp

Row = dict[str, Any]

WARM_UP = Cycle.from_samples("warm-up", range(6), [10.0] * 6)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; see the module."""
    module = "qpmpc.verification.dynamic_programming.quick_error"
    parser = argparse.ArgumentParser(prog=f"python -m {module}")
    parser.add_argument("cycles", nargs="*", help="names or CSV files; all shipped ones if none")
    parser.add_argument("--vehicle", action="append", help="may be repeated; all if not given")
    parser.add_argument("--json", type=Path, help="file for the same as data")
    given = parser.parse_args(arguments)
    try:
        if given.json:
            check_file(given.json, "--json")
        rows = compared(given.cycles or cycle_names(), given.vehicle or vehicle_names())
    except QpmpcError as error:
        print(f"qpmpc: {shown(str(error))}", file=sys.stderr)
        return 2
    if given.json:
        write_text(given.json, json_text({"rows": rows, **summary(rows)}))
    print(markdown(rows), end="")
    return 0


def compared(cycles: Sequence[str], vehicles: Sequence[str]) -> list[Row]:
    """Solve each cycle with each car on both grids.

    Raises
    ------
    InputError
        If a cycle or vehicle cannot be used.
    """
    each = [(cycle, vehicle) for cycle in cycles for vehicle in vehicles]
    for cycle, vehicle in each:  # before any time is spent
        load_cycle(cycle)
        load_vehicle(vehicle)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("both grids", total=len(each))
        return in_order(_of_pair, each, lambda done, _: bar.update(task, completed=done))


def _of_pair(pair: tuple[str, str]) -> Row:
    return quick_and_reference(*pair)


def quick_and_reference(cycle: str, vehicle: str) -> Row:
    """Return fuel and processor time of both grids, and 100 (m_quick / m_reference - 1).

    The difference is null where a grid has found no admissible trajectory, or no fuel is burnt.
    """
    trip, car = load_cycle(cycle), load_vehicle(vehicle)
    quick, reference = (DpSettings(grid=name, threads=1) for name in ("quick", "reference"))
    solve_dp(WARM_UP, car, quick, use_cache=False)  # numba's machine code is loaded
    row: Row = {"cycle": trip.name, "vehicle": car.name, "duration_s": trip.duration_s}
    solutions = []
    for settings in (quick, reference):
        start = process_time()
        solution = solve_dp(trip, car, settings, use_cache=False)
        row[settings.grid] = {
            "fuel_g": solution.fuel_total_g,
            "cpu_s": process_time() - start,
            "admissible": solution.admissible,
            "converged": solution.converged,
        }
        solutions.append(solution)
    fuels = [solution.fuel_total_g for solution in solutions]
    fair = all(solution.admissible for solution in solutions) and fuels[1] > 0.0
    return {**row, "difference_percent": 100.0 * (fuels[0] / fuels[1] - 1.0) if fair else None}


def summary(rows: Sequence[Row]) -> Row:
    """Return mean and extremes of the differences; null if there are none."""
    found = [row["difference_percent"] for row in rows if row["difference_percent"] is not None]
    return {
        "mean_percent": sum(found) / len(found) if found else None,
        "least_percent": min(found, default=None),
        "greatest_percent": max(found, default=None),
        "compared": len(found),
        "of": len(rows),
    }


def markdown(rows: Sequence[Row]) -> str:
    """Return the table, a row for each cycle and car, and its summary in a line."""
    lines = [
        "| cycle | s | vehicle | quick g | reference g | quick above % | quick s | reference s |",
        "|---|---:|---|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        quick, reference, percent = row["quick"], row["reference"], row["difference_percent"]
        difference = "not admissible" if percent is None else _percent(percent)
        lines.append(
            f"| {cell(row['cycle'])} | {row['duration_s']:.0f} | {cell(row['vehicle'])} "
            f"| {quick['fuel_g']:.3f} | {reference['fuel_g']:.3f} | {difference} "
            f"| {quick['cpu_s']:.2f} | {reference['cpu_s']:.2f} |"
        )
    of = summary(rows)
    if of["compared"]:
        lines += [
            "",
            f"{of['compared']} of {of['of']} compared: the quick grid burns "
            f"{_percent(of['mean_percent'])} % more in the mean, from "
            f"{_percent(of['least_percent'])} to {_percent(of['greatest_percent'])} %.",
        ]
    return "\n".join(lines) + "\n"


def _percent(value: float) -> str:
    return f"{round(value, 4) + 0.0:.4f}"  # no minus before a zero


def cell(text: str) -> str:
    """Return a name as a cell of a Markdown table."""
    return shown(text).replace("|", "\\|")


if __name__ == "__main__":
    sys.exit(main())
