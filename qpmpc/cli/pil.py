"""``qpmpc pil``: the generated firmware drives a cycle, instruction by instruction."""

from typing import Annotated

import typer

from qpmpc.cli.options import CycleArgument, JsonOption, OutOption, SetOption, VehicleOption


def pil(
    cycle: CycleArgument,
    target: Annotated[str, typer.Option(metavar="TARGET", help="cortex-m7.")] = "cortex-m7",
    precision: Annotated[str, typer.Option(metavar="f32|f64", help="Of all arithmetic.")] = "f32",
    solver: Annotated[str, typer.Option(metavar="admm|osqp", help="Of the firmware.")] = "admm",
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Run the controller's firmware in QEMU against the Python plant: processor in the loop.

    Instructions are counted on the target and exact; milliseconds are estimates. Every command is
    compared with the Python controller's in the same state. With --out: steps (CSV), figures
    (JSON), picture (PNG).

    For example:

      qpmpc pil nycc

      qpmpc pil nedc-truncated --set mh_qp.osqp.iterations=25 --out results/pil
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.codegen.generate import PRECISIONS, SOLVERS, one_of
    from qpmpc.codegen.pil import processor_in_the_loop
    from qpmpc.codegen.pil_report import pil_lines, write_pil
    from qpmpc.cycles import load_cycle

    one_of(target, ("cortex-m7",), "target")
    chosen = one_of(precision, PRECISIONS, "precision")
    of_solver = one_of(solver, SOLVERS, "solver")
    car, settings = load_vehicle_and_settings(vehicle, set_)
    trip = load_cycle(cycle)
    check_outputs(json_file, out)
    with progress_bar(1) as bar:
        report = bar.next_job(f"{trip.name}, firmware {solver} {precision}")
        result = processor_in_the_loop(trip, car, settings, chosen, report, of_solver)
    write_json(result.summary(), json_file)
    console = result_console(json_file)
    for line in pil_lines(result):
        console.print(line, markup=False)
    if out is not None:
        for remark in write_pil(result, out):
            console.print(remark, markup=False)
