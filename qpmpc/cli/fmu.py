"""``qpmpc fmu``: the controller, or the plant, as a Functional Mock-up Unit."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.options import SetOption, VehicleOption
from qpmpc.cli.parts import ControllerOption, CycleOption, PartOption, PrecisionOption


def fmu(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.fmu",
            help="To be written; its name becomes the model identifier.",
            show_default=False,
        ),
    ],
    cycle: CycleOption = None,
    part: PartOption = "controller",
    fmi: Annotated[str, typer.Option(metavar="2|3", help="Version 2.0 or 3.0 of FMI.")] = "2",
    controller: ControllerOption = "mh-qp",
    precision: PrecisionOption = "f64",
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
) -> None:
    """Write the controller, or the plant, as an FMU for co-simulation, FMI 2.0 or 3.0.

    It holds C sources and a library for this machine, and steps by one second. docs/fmu.md has its
    variables and how to connect them.

    For example:

      qpmpc fmu controller.fmu --cycle nycc

      qpmpc fmu plant.fmu --part plant --cycle nycc

      qpmpc fmu costate.fmu --cycle nycc --controller mh-costate --fmi 3
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.parts import part_of
    from qpmpc.codegen.fmu.description import FMIS, VERSION
    from qpmpc.codegen.fmu.export import checked_name, export_fmu
    from qpmpc.codegen.generate import one_of

    of_fmi = one_of(fmi, FMIS, "version of FMI")
    checked_name(file)
    made, remarks = part_of(context, part, cycle, controller, precision, vehicle, set_)
    platform = export_fmu(made, file, of_fmi)
    console = result_console()
    console.print(
        f"{file}: FMI {VERSION[of_fmi]} co-simulation, steps of 1 s, sources and a library for "
        f"{platform}. {made.description}"
    )
    for line in remarks:
        console.print(line)
