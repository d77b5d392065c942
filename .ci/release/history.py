"""Extend the benchmark history by this commit, and draw it.

``make history`` measures, puts the rows of the checked-out commit into .ci/release/history.csv,
in place of any it has there, and draws docs/images/history.png. Instructions are counted by QEMU
and fuel is simulated: both are the same on every machine with the same compiler, and may be
compared across commits. Times may not: with ``--wall``, on a machine that does nothing else, rows
of the largest step are added that name the processor.
"""

import csv
import subprocess
import sys
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

import qpmpc
from qpmpc.codegen.firmware import COMPILER, require_tools
from qpmpc.codegen.pil.loop import processor_in_the_loop
from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.files import write_bytes, write_text
from qpmpc.report.provenance import provenance

ROOT = Path(__file__).resolve().parents[2]
HISTORY = ROOT / ".ci" / "release" / "history.csv"
PICTURE = ROOT / "docs" / "images" / "history.png"
CONTROLLERS = ("mh-qp", "mh-costate")
STEPS = 6  # every step takes the same instructions
TIMED = "nycc"  # the cycle of times


class Row(NamedTuple):
    """A measured value; `made_with` is what it depends on beside the commit."""

    commit: str
    date: str
    version: str
    measure: str
    unit: str
    value: str
    made_with: str


def read_history(file: Path = HISTORY) -> list[Row]:
    """Return all rows, the oldest commit first."""
    with file.open(encoding="utf-8", newline="") as stream:
        return [Row(*cells) for cells in csv.reader(stream)][1:]


def with_rows(old: list[Row], new: list[Row]) -> list[Row]:
    """Return a history extended by the rows of one commit, which replace those it has."""
    measured = {(row.commit, row.measure) for row in new}
    return [row for row in old if (row.commit, row.measure) not in measured] + new


def history_text(rows: list[Row]) -> str:
    """Return rows as CSV."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([Row._fields, *rows])
    return stream.getvalue()


def measured(wall: bool) -> Iterator[tuple[str, str, str, str]]:
    """Yield measure, unit, value and what it was made with."""
    require_tools()
    asked = [COMPILER, "-dumpfullversion"]
    said = subprocess.run(asked, capture_output=True, text=True, check=True)
    compiler = f"{COMPILER} {said.stdout.strip()}"
    for controller in CONTROLLERS:
        count = str(instructions(controller))
        yield f"{controller} f32 step", "instructions", count, compiler
    cycles = list(cycle_names())
    runs = qpmpc.compare(cycles, [*CONTROLLERS, "dp"])
    rows = [row for row in runs.rows() if row["controller"] in CONTROLLERS]
    for row in rows:
        value = f"{row['fuel_above_dp_percent']:.4f}"
        yield f"{row['controller']} above DP {row['cycle']}", "%", value, ""
    processor = provenance()["processor"]
    for row in rows if wall else ():
        if row["cycle"] == TIMED:
            value = f"{row['step_time_ms']['max']:.4f}"
            yield f"{row['controller']} largest step {TIMED}", "ms", value, processor


def instructions(controller: str) -> int:
    """Count those of a step of the firmware without departure, in QEMU."""
    whole = load_cycle(TIMED)
    start = Cycle.from_samples("start", whole.time_s[: STEPS + 1], whole.speed_mps[: STEPS + 1])
    trip = qpmpc.Trip(start)
    unprepared = {"mh_qp.prepared": False} if controller == "mh-qp" else {}
    settings = qpmpc.ControllerSettings().with_settings(unprepared)
    result = processor_in_the_loop(trip, settings, "f32", controller=controller)
    return int(np.max(result.instructions))


def picture(rows: list[Row]) -> bytes:
    """Draw each measure over the commits; times are left out."""
    from io import BytesIO

    from matplotlib.figure import Figure

    commits = list(dict.fromkeys(row.commit for row in rows))
    units = {"instructions": "million instructions per step (f32)", "%": "fuel above DP, %"}
    figure = Figure(figsize=(10, 4), layout="constrained")
    for axes, (unit, title) in zip(figure.subplots(1, 2), units.items(), strict=True):
        scale = 1e6 if unit == "instructions" else 1.0
        of_unit = [row for row in rows if row.unit == unit]
        # one colour for what is measured, one line for each controller
        subjects = list(dict.fromkeys(_split(row.measure)[1] for row in of_unit))
        for measure in dict.fromkeys(row.measure for row in of_unit):
            controller, subject = _split(measure)
            points = {
                row.commit: float(row.value) / scale for row in of_unit if row.measure == measure
            }
            axes.plot(
                [commits.index(commit) for commit in points],
                list(points.values()),
                "o-" if controller == CONTROLLERS[0] else "s--",
                color=f"C{subjects.index(subject)}",
                label=f"{controller} {subject}",
                markersize=4,
            )
        axes.set_xticks(range(len(commits)), commits, rotation=30, ha="right", fontsize=7)
        axes.set_title(title, fontsize=10)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=110, metadata={"Software": None})
    return stream.getvalue()


def _split(measure: str) -> tuple[str, str]:
    controller, _, subject = measure.partition(" ")
    return controller, subject.removeprefix("above DP ").removeprefix("f32 ")


def commit_and_date() -> tuple[str, str]:
    """Return the commit that is checked out, and its day.

    Raises
    ------
    SystemExit
        If the checkout differs from it: a row must be repeatable.
    """
    outputs = [f":!{file.relative_to(ROOT)}" for file in (HISTORY, PICTURE)]
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", ".", *outputs)
    if changed:
        sys.exit(f"commit first, so that the rows have a commit: {changed.splitlines()[0].strip()}")
    return _git("rev-parse", "--short=10", "HEAD"), _git("show", "-s", "--format=%cs", "HEAD")


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def main(arguments: list[str]) -> None:
    """Measure, write and draw; say by how much each value differs from the last one."""
    if arguments not in ([], ["--wall"]):
        sys.exit("usage: history.py [--wall]")
    commit, date = commit_and_date()
    old = read_history() if HISTORY.exists() else []
    before = {row.measure: row.value for row in old if row.commit != commit}
    new = []
    for measure, unit, value, made_with in measured(wall=bool(arguments)):
        new.append(Row(commit, date, qpmpc.__version__, measure, unit, value, made_with))
        was = f", before {before[measure]}" if measure in before else ""
        print(f"{measure}: {value} {unit}{was}", flush=True)
    rows = with_rows(old, new)
    write_text(HISTORY, history_text(rows))
    write_bytes(PICTURE, picture(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
