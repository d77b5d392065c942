"""``qpmpc pil``: the generated firmware drives a cycle, with instructions counted."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.options import CycleArgument, JsonOption, OutOption, SetOption, VehicleOption

if TYPE_CHECKING:
    from qpmpc.codegen.generate import Algorithm, Precision
    from qpmpc.codegen.method import Generated
    from qpmpc.controllers.settings import ControllerSettings
    from qpmpc.trip import Trip


def pil(
    cycle: CycleArgument,
    controller: Annotated[str, typer.Option(metavar="NAME", help="mh-qp or mh-costate.")] = "mh-qp",
    target: Annotated[str, typer.Option(metavar="TARGET", help="cortex-m7.")] = "cortex-m7",
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
            help="K = 10, 25, 50, 100 with both precisions and algorithms, or those named: "
            "instructions and memory against fuel above DP.",
        ),
    ] = False,
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Run the controller's firmware in QEMU against the Python plant: processor in the loop.

    Instructions are counted on the target and exact; milliseconds are estimates. Every command is
    compared with the Python controller's in the same state. With --out: steps (CSV), figures
    (JSON), picture (PNG), report (HTML).

    For example:

      qpmpc pil nycc

      qpmpc pil nedc-truncated --set mh_qp.admm.iterations=25 --out results/pil

      qpmpc pil nycc --controller mh-costate

      qpmpc pil nycc --pareto --out results/pil
    """
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.codegen.firmware import require_tools
    from qpmpc.codegen.generate import ALGORITHMS, PRECISIONS, one_of
    from qpmpc.codegen.method import GENERATED
    from qpmpc.errors import InputError
    from qpmpc.registry import check_controllers
    from qpmpc.trip import Trip

    one_of(target, ("cortex-m7",), "target")
    name = one_of(controller, GENERATED, "generated controller")
    if name != "mh-qp" and (algorithm is not None or pareto):
        option = "--pareto" if pareto else "--algorithm"
        raise InputError(f"{option} is for mh-qp alone, not for {name}: leave it out")
    precisions = PRECISIONS if precision is None else (one_of(precision, PRECISIONS, "precision"),)
    algorithms = ALGORITHMS if algorithm is None else (one_of(algorithm, ALGORITHMS, "algorithm"),)
    car, settings = load_vehicle_and_settings(vehicle, set_)
    trip = Trip(cycle, car)
    check_outputs(json_file, out)
    if pareto:
        check_controllers(["dp"])
    require_tools()
    if pareto:
        _pareto(trip, settings, precisions, algorithms, json_file, out)
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
