"""``qpmpc compare``: several controllers on several cycles."""

from typing import Annotated

import typer

from qpmpc.cli.completion import complete_controllers, complete_cycle
from qpmpc.cli.options import JsonOption, OptionalVehicleOption, OutOption, PlantOption, SetOption

DEFAULT_CONTROLLERS = "rule-based,mh-qp-paper,mh-qp"


def compare(
    cycles: Annotated[
        list[str],
        typer.Argument(
            metavar="CYCLE...",
            autocompletion=complete_cycle,
            help="Shipped cycles (see [b]qpmpc cycles[/b]), trips or files (CSV, GPX, MDF).",
            show_default=False,
        ),
    ],
    controllers: Annotated[
        str,
        typer.Option(
            metavar="NAME,NAME,...",
            autocompletion=complete_controllers,
            help="Such as mh-nlp, dp; a wrong name lists all.",
        ),
    ] = DEFAULT_CONTROLLERS,
    vehicle: OptionalVehicleOption = None,
    plant: PlantOption = None,
    set_: SetOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Compare controllers on cycles: fuel, savings, limits, time per step.

    With --out: a picture and trajectories of each cycle, the figures, and an HTML report.

    For example:

      qpmpc compare nycc nedc-truncated --out results

      qpmpc compare my_trip.csv --controllers rule-based,mh-qp,dp --json -

      qpmpc compare nycc --vehicle my_car.toml --set trip.soc_init=0.55

      qpmpc compare nycc --plant fastsim --controllers fastsim,rule-based,mh-qp
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.comparison import compare as run
    from qpmpc.errors import InputError
    from qpmpc.problems import shown_value
    from qpmpc.registry import PLANTS, check_controllers, controller_names
    from qpmpc.report.columns import COMPARE_COLUMNS
    from qpmpc.report.table import print_rows
    from qpmpc.settings import parse_settings

    names = [name.strip() for name in controllers.split(",")]
    if plant is not None:
        PLANTS.check(plant)
    for cycle in cycles:
        if cycle in controller_names():
            raise InputError(
                f"{shown_value(cycle)} is no cycle but a controller: choose it with --controllers "
                f"rule-based,{cycle}, no space after the comma"
            )
    check_controllers(names, own=plant or "")
    settings = parse_settings(set_ or [])
    check_outputs(json_file, out)
    with progress_bar(len(cycles) * len(names)) as bar:
        runs = run(cycles, names, vehicle, settings=settings, plant=plant, next_job=bar.next_job)
    rows = runs.rows()
    write_json({"runs": rows}, json_file)
    remarks = runs.remarks()
    if out is not None:
        remarks += runs.write(out)
    console = result_console(json_file)
    print_rows(console, rows, COMPARE_COLUMNS, "cycle")
    for remark in remarks:
        console.print(remark)
