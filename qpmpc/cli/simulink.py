"""``qpmpc simulink``: the controller, or the plant, as an S-function of Simulink."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.options import SetOption, VehicleOption
from qpmpc.cli.parts import ControllerOption, CycleOption, PartOption, PrecisionOption


def simulink(
    context: typer.Context,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="Folder to be written; its name becomes that of the S-function.",
            show_default=False,
        ),
    ],
    cycle: CycleOption = None,
    part: PartOption = "controller",
    controller: ControllerOption = "mh-qp",
    precision: PrecisionOption = "f64",
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
) -> None:
    """Write the controller, or the plant, as an S-function of Simulink: C and build.m.

    MATLAB builds it, with run('DIR/build.m'); here nothing is compiled. It was tested against a
    stub of Simulink's header and never run in Simulink. docs/simulink.md has its ports.

    For example:

      qpmpc simulink controller --cycle nycc

      qpmpc simulink plant --part plant --cycle nycc

      qpmpc simulink costate --cycle nycc --controller mh-costate --precision f32
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.parts import part_of
    from qpmpc.codegen.simulink.export import checked_name, export_s_function

    name = checked_name(folder)
    made, remarks = part_of(context, part, cycle, controller, precision, vehicle, set_)
    files = export_s_function(made, folder)
    console = result_console()
    console.print(
        f"{folder}: S-function {name}, steps of 1 s, {len(files)} files written; start with "
        f"README.md. {made.description}"
    )
    for line in remarks:
        console.print(line)
