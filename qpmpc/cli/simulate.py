"""``qpmpc simulate``: one cycle, one controller."""

from typing import Annotated

import typer

from qpmpc.cli.completion import complete_controller
from qpmpc.cli.options import (
    CycleArgument,
    ForecastOption,
    InjectOption,
    JsonOption,
    OutOption,
    SetOption,
    VehicleOption,
)


def simulate(
    cycle: CycleArgument,
    controller: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            autocompletion=complete_controller,
            help="Such as mh-qp, mh-nlp, dp; a wrong name lists all.",
        ),
    ] = "mh-qp",
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
    forecast: ForecastOption = None,
    inject: InjectOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Drive one cycle with one controller on the nonlinear plant.

    With --out: trajectory (CSV), figures (JSON) and picture (PNG) of the run.

    For example:

      qpmpc simulate nycc

      qpmpc simulate my_trip.csv --vehicle prius-liion --out results

      qpmpc simulate udds --set thermal.t_amb_degc=-15 --set mh_qp.admm.iterations=25 --json -

      qpmpc simulate nycc --forecast "travel time:3"

      qpmpc simulate nycc --inject my_faults.toml
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.faults.effects import sentences
    from qpmpc.faults.models import load_faults
    from qpmpc.preview.forecast_errors import forecast as wrong_forecast
    from qpmpc.preview.forecast_errors import parse_forecast
    from qpmpc.registry import check_controllers, split_settings
    from qpmpc.report.columns import SIMULATE_COLUMNS, notes
    from qpmpc.report.table import print_rows
    from qpmpc.report.write import write_run
    from qpmpc.settings import parse_settings
    from qpmpc.simulation import simulate as run
    from qpmpc.trip import Trip
    from qpmpc.vehicle import load_vehicle

    check_controllers([controller])
    settings = parse_settings(set_ or [])
    faults = None if inject is None else load_faults(inject)
    of_vehicle, _ = split_settings(settings, [controller])
    trip = Trip(cycle, load_vehicle(vehicle)).with_settings(of_vehicle)
    if forecast is not None:
        model, seed = parse_forecast(forecast)
        trip = trip.with_forecast(wrong_forecast(trip.cycle, trip.believed, model, seed))
    check_outputs(json_file, out)
    with progress_bar(1) as bar:
        report = bar.next_job(f"{trip.cycle.name}, {controller}")
        finished = run(trip, controller, settings=settings, faults=faults, progress=report)
    summary = finished.summary()
    if forecast is not None:
        summary["remarks"].append(f"the long horizon saw a wrong forecast: {model}, seed {seed}")
    write_json(summary, json_file)
    remarks = [*notes([summary]), *summary["remarks"]]
    if finished.faults is not None:
        remarks += sentences(finished.faults)
    if out is not None:
        remarks += write_run(finished, out)
    console = result_console(json_file)
    print_rows(console, [summary], SIMULATE_COLUMNS, "cycle")
    for remark in remarks:
        console.print(remark)
