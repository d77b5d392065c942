"""``qpmpc pil`` with a board: its project made, its log read."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from qpmpc.errors import InputError

if TYPE_CHECKING:
    from qpmpc.codegen.board.project import BoardTarget
    from qpmpc.codegen.generate import Algorithm, Precision
    from qpmpc.codegen.method import Generated
    from qpmpc.controllers.settings import ControllerSettings
    from qpmpc.trip import Trip

# of `qpmpc pil`, by their parameters: with a log the project has them
OF_PROJECT = (
    *("cycle", "controller", "target", "precision", "algorithm", "pareto", "vehicle", "set_"),
    "seconds",
)
# without a board they say nothing
OF_BOARD = ("seconds", "clock_mhz")


def given(context: typer.Context, names: tuple[str, ...]) -> list[str]:
    """Return those of the parameters that the command line names, as options."""
    sources = {name: context.get_parameter_source(name) for name in names}
    options = {"cycle": "CYCLE", "json_file": "--json", "set_": "--set"}
    return [
        options.get(name, f"--{name.replace('_', '-')}")
        for name, source in sources.items()
        if source is not None and source.name == "COMMANDLINE"
    ]


def refuse(context: typer.Context, names: tuple[str, ...], why: str) -> None:
    """Refuse parameters that would have no effect.

    Raises
    ------
    InputError
        If the command line names one.
    """
    found = given(context, names)
    if found:
        raise InputError(f"{found[0]} has no effect {why}: leave it out")


def make(
    trip: "Trip",
    settings: "ControllerSettings",
    folder: Path,
    target: "BoardTarget",
    controller: "Generated",
    precision: "Precision",
    algorithm: "Algorithm",
    seconds: int | None,
    clock_mhz: float | None,
) -> None:
    """Write the project and say what to do next."""
    from qpmpc.cli.console import progress_bar, result_console
    from qpmpc.codegen.board.project import write_project

    with progress_bar(1) as bar:
        report = bar.next_job(f"{trip.cycle.name}, recorded with {controller}")
        project = write_project(
            trip,
            settings,
            folder,
            target,
            precision,
            algorithm,
            controller,
            seconds,
            clock_mhz,
            report,
        )
    about, console = project.manifest, result_console()
    console.print(
        f"{folder}: {about.seconds} s of {about.cycle} recorded with {controller}, to be replayed "
        f"on {target} in {precision}; identity {about.identity}; start with REPLAY.md"
    )
    for name in project.kept:
        console.print(f"{name} was there and is kept: it is yours to edit")
    for remark in (*project.remarks, *trip.remarks):
        console.print(remark)


def read(
    folder: Path, file: Path, clock_mhz: float | None, json_file: Path | None, out: Path | None
) -> None:
    """Read a log, check every command, and show the table."""
    from qpmpc.cli.console import result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.codegen.board.check import check_log
    from qpmpc.codegen.board.manifest import NAME as MANIFEST
    from qpmpc.codegen.board.report import board_lines, board_table, write_board

    check_outputs(json_file, out)
    for read_from in (file, folder / MANIFEST):
        if json_file is not None and json_file.resolve() == read_from.resolve():
            raise InputError(f"--json {json_file}: would overwrite what is read; name another file")
    result = check_log(folder, file, clock_mhz)
    data = result.summary()
    write_json(data, json_file)
    console = result_console(json_file)
    console.print(board_table(data))
    for line in board_lines(data):
        console.print(line)
    if out is not None:
        for remark in write_board(result, out):
            console.print(remark)
