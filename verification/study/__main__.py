"""``python -m qpmpc.verification.study [--out DIR] [--quick]``: run the search, write tables."""

import argparse
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from qpmpc.cycles import load_cycle
from qpmpc.files import check_folder, json_text, write_bytes, write_text
from qpmpc.report.provenance import provenance
from qpmpc.shown import shown
from qpmpc.vehicle import load_vehicle, vehicle_names
from qpmpc.verification.study.picture import draw_study
from qpmpc.verification.study.study import places, study
from qpmpc.verification.study.variants import variants

CYCLES = ("nycc", "nedc-truncated", "udds", "hwfet", "wltc-3b")
AMBIENTS_DEGC = (-15.0, -7.0, 10.0)


def main(arguments: list[str] | None = None) -> int:
    """Run the study; see the module."""
    parser = argparse.ArgumentParser(prog="python -m qpmpc.verification.study")
    parser.add_argument("--out", type=Path, default=Path("results/study"))
    parser.add_argument("--quick", action="store_true", help="NYCC, default vehicle and ambient")
    given = parser.parse_args(arguments)
    check_folder(given.out, "--out")
    cars = [load_vehicle(name) for name in vehicle_names()]
    cycles = [load_cycle(name) for name in CYCLES]
    with Progress(console=Console(stderr=True), transient=True) as bar:
        where = places(cycles[:1], cars[:1]) if given.quick else places(cycles, cars)
        chosen = variants()[:3] if given.quick else variants()
        task = bar.add_task("variants", total=len(chosen))
        rows = study(chosen, where, lambda: bar.advance(task))
        weather: list[dict[str, Any]] = []
        if not given.quick:
            task = bar.add_task("weather", total=len(AMBIENTS_DEGC))
            for ambient in AMBIENTS_DEGC:
                there = [car.with_settings({"thermal.t_amb_degc": ambient}) for car in cars]
                weather += study(chosen[:1], places(cycles, there), lambda: None)
                bar.advance(task)
    data = {"variants": rows, "weather": weather, "provenance": provenance()}
    write_text(given.out / "study.json", json_text(data))
    write_text(given.out / "study.md", markdown(rows))
    write_bytes(given.out / "study.png", draw_study(rows))
    written = f"{given.out / 'study.md'} written, with study.json and study.png"
    Console().print(shown(written), markup=False)
    return 0


def markdown(rows: list[dict[str, Any]]) -> str:
    """Return the table of a study."""
    lines = [
        "| setting | value | above DP, mean % | max % | violated in | integral % | step ms |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['group']} | {row['label']} | {row['mean_percent']:.2f} | {row['max_percent']:.2f} "
        f"| {len(row['violated'])} | {100 * row['sigma_integral_share']:.0f} "
        f"| {row['step_ms']:.2f} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
