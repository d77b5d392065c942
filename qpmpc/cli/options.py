"""Arguments and options that commands share."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.completion import (
    complete_cycle,
    complete_plant,
    complete_setting,
    complete_vehicle,
)

CYCLE_ARGUMENT = typer.Argument(
    metavar="CYCLE",
    autocompletion=complete_cycle,
    help="A shipped cycle (see [b]qpmpc cycles[/b]), a trip (see [b]qpmpc trips[/b]) or a "
    "file: CSV with time_s,speed_mps[dim],grade[/dim], or a log with units of its own, GPX, "
    "MDF.",
    show_default=False,
)
CycleArgument = Annotated[str, CYCLE_ARGUMENT]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE.toml",
        autocompletion=complete_vehicle,
        help="A shipped vehicle (see [b]qpmpc vehicles[/b]) or a TOML file, "
        "complete or with a base.",
    ),
]
OptionalVehicleOption = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE.toml",
        autocompletion=complete_vehicle,
        help="A shipped vehicle (see [b]qpmpc vehicles[/b]) or a TOML file, "
        "complete or with a base.",
        show_default="prius-nimh",
    ),
]
PlantOption = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="NAME",
        autocompletion=complete_plant,
        help="Drive somebody else's plant in place of ours: fastsim (a Prius) or fastsim-sonata (a "
        "Sonata with its heat), whose own control is then the controller of that name. Controllers "
        "believe in a car derived from it; --vehicle gives them another engine's fuel.",
        show_default=False,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        autocompletion=complete_setting,
        help="Change a parameter of the vehicle or of a controller by its dotted name; repeatable. "
        "A wrong name lists the right ones.",
        show_default=False,
    ),
]
JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the figures as JSON; - is standard output, the table then goes to stderr.",
        show_default=False,
    ),
]
InjectOption = Annotated[
    Path | None,
    typer.Option(
        "--inject",
        metavar="FAULTS.toml",
        help="Drive under the faults of this file, and say what each of them did.",
        show_default=False,
    ),
]
ForecastOption = Annotated[
    str | None,
    typer.Option(
        "--forecast",
        metavar="MODEL[:SEED]",
        help="Let the long horizon see a wrong forecast; a wrong model lists all.",
        show_default=False,
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Write files into this folder.", show_default=False),
]
