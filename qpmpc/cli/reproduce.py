"""``qpmpc reproduce``: the paper's figures and tables beside ours."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.options import JsonOption, SetOption, VehicleOption


def reproduce(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the report.")
    ] = Path("results/reproduction"),
    json_file: JsonOption = None,
    vehicle: VehicleOption = "paper-nimh",
    set_: SetOption = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Beginnings of the cycles, coarse grids: a trial run."),
    ] = False,
) -> None:
    """Reproduce the paper: every figure and table, ours beside the paper's.

    Writes pictures (PNG, SVG), their numbers (CSV) and one self-contained HTML report with
    dynamic programming, all controllers, experiments and wrong forecasts. Takes some minutes;
    results of dynamic programming are kept for the next time.

    For example:

      qpmpc reproduce --out results/reproduction

      qpmpc reproduce --vehicle paper-liion --set thermal.t_amb_degc=-15 --out results/cold
    """
    from importlib.util import find_spec

    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.errors import InputError
    from qpmpc.registry import check_controllers
    from qpmpc.verification.reproduction import Extent, job_count, run_study

    car, settings = load_vehicle_and_settings(vehicle, set_)
    check_outputs(json_file, out)
    check_controllers(["dp"])
    if find_spec("matplotlib") is None:
        raise InputError("reproduce needs matplotlib: pip install 'qpmpc-iptm[plot,verification]'")
    from qpmpc.verification.reproduction.report import study_data, write_report

    extent = Extent.quick() if quick else Extent.full()
    with progress_bar(job_count(extent)) as bar:
        study = run_study(car, settings, extent, bar)
    data = study_data(study)
    page = write_report(study, out)
    write_json(data, json_file)
    console = result_console(json_file)
    for check in data["checks"]:
        mark = "holds" if check["holds"] else "DOES NOT HOLD"
        console.print(f"{mark:13}  {check['name']}: {check['measured']}")
    console.print(f"{page} written")
