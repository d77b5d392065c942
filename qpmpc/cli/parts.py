"""A part for a simulation tool, from the options that ``qpmpc fmu`` and ``simulink`` share."""

from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.completion import complete_generated

if TYPE_CHECKING:
    from qpmpc.codegen.parts.part import Part

CycleOption = Annotated[
    str | None,
    typer.Option(
        metavar="CYCLE",
        help="The trip inside, as for [b]qpmpc simulate[/b]: the preview, which the controller "
        "needs; the road of the plant, whose demand and speed are inputs without it.",
        show_default=False,
    ),
]
PartOption = Annotated[str, typer.Option(metavar="controller|plant", help="What it holds.")]
ControllerOption = Annotated[
    str,
    typer.Option(metavar="NAME", help="mh-qp or mh-costate.", autocompletion=complete_generated),
]
PrecisionOption = Annotated[
    str, typer.Option(metavar="f32|f64", help="Of the controller's arithmetic.")
]


def part_of(
    context: typer.Context,
    part: str,
    cycle: str | None,
    controller: str,
    precision: str,
    vehicle: str,
    overrides: list[str] | None,
) -> tuple["Part", list[str]]:
    """Return the part that options name, and remarks for its user.

    Raises
    ------
    InputError
        If an option is wrong, missing or without effect.
    """
    from qpmpc.cli.board import refuse
    from qpmpc.cli.inputs import load_vehicle_and_settings
    from qpmpc.codegen.generate import PRECISIONS, one_of
    from qpmpc.codegen.method import GENERATED
    from qpmpc.codegen.parts.part import controller_part, plant_part
    from qpmpc.errors import InputError
    from qpmpc.registry import is_of_vehicle, without_effect
    from qpmpc.settings import parse_settings
    from qpmpc.trip import Trip

    of_part = one_of(part, ("controller", "plant"), "part")
    name = one_of(controller, GENERATED, "generated controller")
    of_precision = one_of(precision, PRECISIONS, "precision")
    chosen = parse_settings(overrides or [])
    if of_part == "plant":
        refuse(context, ("controller", "precision"), "with --part plant")
        for key in chosen:
            if not is_of_vehicle(key):
                raise InputError(f"--set {key} has no effect with --part plant: leave it out")
    elif cycle is None:
        raise InputError("--part controller needs --cycle CYCLE, the trip that it previews")
    car, settings = load_vehicle_and_settings(vehicle, overrides)
    trip = None if cycle is None else Trip(cycle, car)
    remarks = [] if trip is None else list(trip.remarks)
    if of_part == "plant" or trip is None:
        return plant_part(car, trip), remarks
    if remark := without_effect(chosen, [name]):
        remarks.insert(0, remark)
    return controller_part(trip, name, settings, of_precision), remarks
