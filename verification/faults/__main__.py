"""``python -m qpmpc.verification.faults [PAGE]``: write the tables of docs/faults.md anew."""

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from qpmpc.files import around_marks, write_text
from qpmpc.pool import in_order
from qpmpc.verification.faults.standard import standard_faults
from qpmpc.verification.faults.table import measured_job, summary, table

CARS = ("prius-nimh", "prius-liion")  # without those of the paper, which no one builds
BEGIN, END = "<!-- faults: written by python -m qpmpc.verification.faults -->", "<!-- end -->"


def main(arguments: list[str] | None = None) -> int:
    """Write the tables between the marks of a page; see the module."""
    parser = argparse.ArgumentParser(prog="python -m qpmpc.verification.faults")
    parser.add_argument("page", type=Path, nargs="?", default=Path("docs/faults.md"))
    page = parser.parse_args(arguments).page
    before, after = around_marks(page, BEGIN, END)
    faults = standard_faults()
    each = [(fault, car) for car in CARS for fault in faults]
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("faults", total=len(each))
        rows = in_order(measured_job, each, lambda done, _: bar.update(task, completed=done))
    parts = []
    for car in CARS:
        of_car, rows = rows[: len(faults)], rows[len(faults) :]
        parts.append(f"### {car}\n\n{car}: {summary(of_car)}\n\n{table(of_car)}")
    write_text(page, before + "\n\n" + "\n".join(parts) + "\n" + after)
    return 0


if __name__ == "__main__":
    sys.exit(main())
