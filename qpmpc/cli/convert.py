"""``qpmpc convert``: a log of any format as the plain CSV of a cycle."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.options import JsonOption

if TYPE_CHECKING:
    from qpmpc.cycles.logs.columns import Said
    from qpmpc.cycles.read_drive import Drive


def _unit(quantity: str, example: str) -> object:
    return typer.Option(
        f"--{quantity}-unit",
        metavar="UNIT",
        help=f"Unit of {quantity}, where the file names none: {example}.",
        show_default=False,
    )


def convert(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A log or schedule: a table in text (CSV), GPX, or MDF (.mf4, .mdf).",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="CYCLE.csv", help="File to write.", show_default=False),
    ],
    speed_unit: Annotated[str | None, _unit("speed", "km/h, mph, m/s, knots")] = None,
    time_unit: Annotated[str | None, _unit("time", "s, ms, min")] = None,
    grade_unit: Annotated[str | None, _unit("grade", "% or - (rise over run)")] = None,
    elevation_unit: Annotated[str | None, _unit("elevation", "m, ft")] = None,
    speed_column: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Column or channel of the speed, if there are several or it has another name.",
            show_default=False,
        ),
    ] = None,
    trip: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="Take this trip only, of a file with a column Trip or with several GPX tracks.",
            show_default=False,
        ),
    ] = None,
    split: Annotated[
        bool,
        typer.Option(
            "--split",
            help="Make a file of each trip, CYCLE-1.csv and so on: split at gaps, where the car is "
            "parked for more than 5 minutes, and by the file's own trips.",
        ),
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """Convert a log or schedule to time_s,speed_mps,grade at 1 Hz; show what was made of it.

    A table shows what was assumed, repaired and left out, another one the statistics of the trip. A
    picture beside the file (CYCLE.png) shows the samples and what is driven.

    For example:

      qpmpc convert my_log.csv --out my_commute.csv

      qpmpc convert my_log.csv --out my_commute.csv --split --json my_commute.json

      qpmpc convert drive.gpx --out drive.csv

      qpmpc convert obd.csv --out drive.csv --speed-unit km/h --time-unit ms
    """
    from qpmpc.cli.console import result_console, write_json
    from qpmpc.cli.inputs import STDOUT, check_outputs
    from qpmpc.cycles.logs.quantities import LogOptions
    from qpmpc.cycles.read_drive import read_drives
    from qpmpc.errors import InputError
    from qpmpc.files import check_file
    from qpmpc.report.table import print_rows, print_texts
    from qpmpc.report.trip_set import CYCLE_COLUMNS, cycle_row
    from qpmpc.report.write import write_drive

    if out.suffix != ".csv":
        raise InputError(f"--out {out}: the file of a cycle ends in .csv")
    check_outputs(json_file, None)
    check_file(out, "--out")
    stated = {
        "speed": speed_unit,
        "time": time_unit,
        "grade": grade_unit,
        "elevation": elevation_unit,
    }
    units = {name: unit for name, unit in stated.items() if unit is not None}
    options = LogOptions(units, speed_column, trip)
    drives, said = read_drives(log, options, split=split, name=out.stem)
    files = [out] if not split else [out.with_name(f"{d.cycle.name}.csv") for d in drives]
    pictures = [file.with_suffix(".png") for file in files]
    for file in (*files, *pictures):
        check_file(file, "--out")
    own = [log, *files, *pictures, *([json_file] if json_file not in (None, STDOUT) else [])]
    if len({file.resolve() for file in own}) < len(own):
        raise InputError(
            "FILE, --out, its picture and --json must be files of their own: "
            f"{', '.join(str(file) for file in own)}"
        )
    rows = [cycle_row(drive.cycle) for drive in drives]
    console = result_console(json_file)
    lines = _lines(drives, said)
    if lines:
        print_texts(console, ("cycle", "", "what"), lines, names=3)
    else:
        console.print("nothing assumed, nothing repaired, nothing left out")
    console.print()
    print_rows(console, rows, CYCLE_COLUMNS, section="name")
    for drive, file in zip(drives, files, strict=True):
        for remark in write_drive(drive, file):
            console.print(remark)
    trips = [
        {
            "file": str(file),
            **row,
            "samples": len(drive.log.time_s),
            "remarks": [each._asdict() for each in drive.said],
        }
        for drive, file, row in zip(drives, files, rows, strict=True)
    ]
    write_json(
        {"file": str(log), "trips": trips, "remarks": [each._asdict() for each in said]}, json_file
    )


def _lines(drives: "Sequence[Drive]", said: "Sequence[Said]") -> list[tuple[str, str, str]]:
    """Rows of the table: whose, which kind, what; what all trips have in common once."""
    common = [each for each in drives[0].said if all(each in drive.said for drive in drives[1:])]
    own = drives[0].cycle.name if len(drives) == 1 else "all"
    rows = [(own, each.kind, each.text) for each in common]
    rows += [("", each.kind, each.text) for each in said]
    rows += [
        (drive.cycle.name, each.kind, each.text)
        for drive in drives
        for each in drive.said
        if each not in common
    ]
    return rows
