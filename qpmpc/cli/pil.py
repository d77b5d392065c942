"""``qpmpc pil``: generated firmware drives a cycle in QEMU, or replays one on a board."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.completion import complete_generated
from qpmpc.cli.options import CYCLE_ARGUMENT, JsonOption, OutOption, SetOption, VehicleOption

if TYPE_CHECKING:
    from qpmpc.codegen.generate import Algorithm, Precision
    from qpmpc.codegen.method import Generated
    from qpmpc.codegen.pil.calibrated import Change
    from qpmpc.controllers.settings import ControllerSettings
    from qpmpc.trip import Trip


def pil(
    context: typer.Context,
    cycle: Annotated[str | None, CYCLE_ARGUMENT] = None,
    controller: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="mh-qp or mh-costate.", autocompletion=complete_generated
        ),
    ] = "mh-qp",
    target: Annotated[
        str,
        typer.Option(metavar="TARGET", help="cortex-m7; with --project linux too."),
    ] = "cortex-m7",
    precision: Annotated[
        str | None,
        typer.Option(
            metavar="f32|f64", help="For all arithmetic; default: f32.", show_default=False
        ),
    ] = None,
    algorithm: Annotated[
        str | None,
        typer.Option(metavar="admm|osqp", help="Of mh-qp; default: admm.", show_default=False),
    ] = None,
    pareto: Annotated[
        bool,
        typer.Option(
            "--pareto",
            help="K = 10, 30, 50, 100 with both precisions and algorithms, or those named: "
            "instructions and memory against fuel above DP.",
        ),
    ] = False,
    calibrate: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE@SECOND",
            help="While the cycle runs, write a number over XCP at the emulator's serial line, in "
            "the unit of docs/calibration.md; repeat it for several.",
            show_default=False,
        ),
    ] = None,
    project: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="For a board of your own: write a project that replays the cycle and logs each "
            "second, in place of QEMU.",
            show_default=False,
        ),
    ] = None,
    seconds: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Of the cycle, for --project; default: all.", show_default=False
        ),
    ] = None,
    from_log: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Read the log of the board that ran --project DIR: check each command, show "
            "times.",
            show_default=False,
        ),
    ] = None,
    clock_mhz: Annotated[
        float | None,
        typer.Option(
            metavar="MHZ",
            help="Clock of the board's core, for --project or --from-log.",
            show_default=False,
        ),
    ] = None,
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Run the controller's firmware in QEMU against the Python plant: processor in the loop.

    Instructions are counted on the target and exact; milliseconds are estimates. Every command is
    compared with the Python controller's in the same state. With --out: steps (CSV), figures
    (JSON), picture (PNG), report (HTML).

    On a board of your own: --project DIR writes a program that replays a recorded trip and prints
    a log; --from-log FILE reads it. docs/embedded.md has the steps.

    For example:

      qpmpc pil nycc

      qpmpc pil nedc-truncated --set mh_qp.admm.iterations=25 --out results/pil

      qpmpc pil nycc --controller mh-costate

      qpmpc pil nycc --pareto --out results/pil

      qpmpc pil nycc --calibrate t_min_degc=49@100 --calibrate soc_min=0.9@200

      qpmpc pil nycc --project my_board --clock-mhz 480

      qpmpc pil --project my_board --from-log board.log
    """
    from qpmpc.cli import board
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.codegen.board.project import BOARD_TARGETS
    from qpmpc.codegen.firmware import require_tools
    from qpmpc.codegen.generate import ALGORITHMS, PRECISIONS, one_of
    from qpmpc.codegen.method import GENERATED
    from qpmpc.codegen.pil.calibrated import Change
    from qpmpc.errors import InputError
    from qpmpc.registry import check_controllers
    from qpmpc.trip import Trip

    if from_log is not None:
        if project is None:
            raise InputError("--from-log needs --project DIR, whose program wrote the log")
        board.refuse(context, board.OF_PROJECT, "with --from-log, the project has it")
        board.read(project, from_log, clock_mhz, json_file, out)
        return
    if cycle is None:
        raise InputError("Missing argument 'CYCLE' (see qpmpc pil --help)")
    if project is None and target == "linux":
        raise InputError("--target linux is for a board of your own: it needs --project DIR")
    of_board = one_of(target, ("cortex-m7",) if project is None else BOARD_TARGETS, "target")
    name = one_of(controller, GENERATED, "generated controller")
    if name != "mh-qp" and (algorithm is not None or pareto):
        option = "--pareto" if pareto else "--algorithm"
        raise InputError(f"{option} is for mh-qp alone, not for {name}: leave it out")
    if calibrate and pareto:
        raise InputError("--calibrate is for one run, not for --pareto: leave one out")
    if project is None:
        board.refuse(context, board.OF_BOARD, "without --project or --from-log")
    precisions = PRECISIONS if precision is None else (one_of(precision, PRECISIONS, "precision"),)
    algorithms = ALGORITHMS if algorithm is None else (one_of(algorithm, ALGORITHMS, "algorithm"),)
    car, settings = load_vehicle_and_settings(vehicle, set_)
    trip = Trip(cycle, car)
    if project is not None:
        board.refuse(context, ("pareto", "calibrate", "json_file", "out"), "with --project")
        chosen = (of_board, name, precisions[0], algorithms[0], seconds, clock_mhz)
        board.make(trip, settings, project, *chosen)
        return
    check_outputs(json_file, out)
    changes = [Change.parsed(text) for text in calibrate or ()]
    if pareto:
        check_controllers(["dp"])
    require_tools()
    if pareto:
        _pareto(trip, settings, precisions, algorithms, json_file, out)
    elif changes:
        _calibrated(trip, changes, settings, precisions[0], algorithms[0], name, json_file, out)
    else:
        _one_run(trip, settings, name, precisions[0], algorithms[0], json_file, out)


def _one_run(
    trip: "Trip",
    settings: "ControllerSettings",
    controller: "Generated",
    precision: "Precision",
    algorithm: "Algorithm",
    json_file: Path | None,
    out: Path | None,
) -> None:
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.codegen.pil.loop import processor_in_the_loop
    from qpmpc.codegen.pil.report import pil_lines, write_pil

    with progress_bar(1) as bar:
        report = bar.next_job(f"{trip.cycle.name}, firmware of {controller} {precision}")
        result = processor_in_the_loop(trip, settings, precision, report, algorithm, controller)
    write_json(result.summary(), json_file)
    console = result_console(json_file)
    for line in (*pil_lines(result), *trip.remarks):
        console.print(line)
    if out is not None:
        for remark in write_pil(result, out):
            console.print(remark)


def _calibrated(
    trip: "Trip",
    changes: "list[Change]",
    settings: "ControllerSettings",
    precision: "Precision",
    algorithm: "Algorithm",
    controller: "Generated",
    json_file: Path | None,
    out: Path | None,
) -> None:
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.codegen.pil.calibrated import calibrated_trip
    from qpmpc.codegen.pil.calibrated_report import (
        HEADER,
        calibrated_line,
        calibrated_rows,
        write_calibrated,
    )
    from qpmpc.report.table import print_texts

    with progress_bar(1) as bar:
        report = bar.next_job(f"{trip.cycle.name}, firmware of {controller} {precision}, twice")
        found = calibrated_trip(trip, changes, settings, precision, algorithm, controller, report)
    write_json(found.as_data(), json_file)
    console = result_console(json_file)
    print_texts(console, HEADER, calibrated_rows(found), names=2)
    for remark in (calibrated_line(found), *trip.remarks):
        console.print(remark)
    if out is not None:
        write_calibrated(found, out)


def _pareto(
    trip: "Trip",
    settings: "ControllerSettings",
    precisions: "tuple[Precision, ...]",
    algorithms: "tuple[Algorithm, ...]",
    json_file: Path | None,
    out: Path | None,
) -> None:
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.codegen.pil.pareto import ITERATIONS, embedded_pareto, job_count
    from qpmpc.codegen.pil.report import pareto_table, write_pareto

    with progress_bar(job_count(precisions, algorithms, ITERATIONS)) as bar:
        found = embedded_pareto(trip, settings, precisions, algorithms, bar.next_job)
    write_json(found.as_data(), json_file)
    console = result_console(json_file)
    console.print(pareto_table(found.rows()))
    for remark in trip.remarks:
        console.print(remark)
    if out is not None:
        for remark in write_pareto(found, out):
            console.print(remark)
