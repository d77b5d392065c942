"""``qpmpc fmu``: the controller, or the plant, as a Functional Mock-up Unit."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.options import SetOption, VehicleOption

if TYPE_CHECKING:
    from qpmpc.codegen.parts.part import Part


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
    cycle: Annotated[
        str | None,
        typer.Option(
            metavar="CYCLE",
            help="The trip inside, as for [b]qpmpc simulate[/b]: the preview, which the controller "
            "needs; the road of the plant, whose demand and speed are inputs without it.",
            show_default=False,
        ),
    ] = None,
    part: Annotated[
        str, typer.Option(metavar="controller|plant", help="What the FMU holds.")
    ] = "controller",
    fmi: Annotated[str, typer.Option(metavar="2|3", help="Version 2.0 or 3.0 of FMI.")] = "2",
    controller: Annotated[str, typer.Option(metavar="NAME", help="mh-qp or mh-costate.")] = "mh-qp",
    precision: Annotated[
        str, typer.Option(metavar="f32|f64", help="Of the controller's arithmetic.")
    ] = "f64",
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
    from qpmpc.cli.board import refuse
    from qpmpc.cli.console import result_console
    from qpmpc.cli.inputs import load_vehicle_and_settings
    from qpmpc.codegen.fmu.description import FMIS, VERSION
    from qpmpc.codegen.fmu.export import checked_name, export_fmu
    from qpmpc.codegen.generate import PRECISIONS, one_of
    from qpmpc.codegen.method import GENERATED
    from qpmpc.codegen.parts.part import controller_part, plant_part
    from qpmpc.errors import InputError
    from qpmpc.registry import is_of_vehicle, without_effect
    from qpmpc.settings import parse_settings
    from qpmpc.trip import Trip

    of_part = one_of(part, ("controller", "plant"), "part")
    of_fmi = one_of(fmi, FMIS, "version of FMI")
    name = one_of(controller, GENERATED, "generated controller")
    of_precision = one_of(precision, PRECISIONS, "precision")
    checked_name(file)
    chosen = parse_settings(set_ or [])
    if of_part == "plant":
        refuse(context, ("controller", "precision"), "with --part plant")
        for key in chosen:
            if not is_of_vehicle(key):
                raise InputError(f"--set {key} has no effect with --part plant: leave it out")
    elif cycle is None:
        raise InputError("--part controller needs --cycle CYCLE, the trip that it previews")
    car, settings = load_vehicle_and_settings(vehicle, set_)
    trip = None if cycle is None else Trip(cycle, car)
    made: Part
    if of_part == "plant" or trip is None:
        made = plant_part(car, trip)
    else:
        made = controller_part(trip, name, settings, of_precision)
    platform = export_fmu(made, file, of_fmi)
    console = result_console()
    console.print(
        f"{file}: FMI {VERSION[of_fmi]} co-simulation, steps of 1 s, sources and a library for "
        f"{platform}. {made.description}"
    )
    if of_part == "controller" and (remark := without_effect(chosen, [name])):
        console.print(remark)
    for line in () if trip is None else trip.remarks:
        console.print(line)
