"""Files of a result: CSV, JSON, pictures, the HTML report."""

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.cycles.read_drive import Drive
from qpmpc.errors import InputError
from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.columns import Row
from qpmpc.report.pwa_curves import PwaCurve
from qpmpc.report.trajectory_csv import trajectory_csv
from qpmpc.report.trip_set import cycle_csv
from qpmpc.results import Run
from qpmpc.vehicle.parameters import Vehicle

if TYPE_CHECKING:  # importing scipy's interpolation takes a third of a second
    from qpmpc.vehicle.from_map import MappedVehicle

PLOT_EXTRA = "pip install 'qpmpc-iptm[plot]'"


def write_run(run: Run, folder: Path) -> list[str]:
    """Write trajectory, figures and picture of one run; returns remarks for the user."""
    stem = f"{run.cycle}_{run.controller}"
    write_text(folder / f"{stem}.csv", trajectory_csv(run))
    write_text(folder / f"{stem}.json", json_text(run.summary()))

    def draw() -> bytes:
        from qpmpc.report.trajectories import draw_trajectories

        return draw_trajectories([run])

    drawn = _write_picture(folder / f"{stem}.png", draw)
    return [f"{folder / stem}.csv, .json{', .png' if not drawn else ''} written", *drawn]


def write_comparison(
    runs: Sequence[Run],
    rows: Sequence[dict[str, Any]],
    settings: ControllerSettings,
    folder: Path,
) -> list[str]:
    """Write trajectories, figures, one picture per cycle and the report; returns remarks.

    Parameters
    ----------
    runs : all with one vehicle
    rows : the same runs, as `compare_runs` returns them
    settings : that they were made with
    """
    for run in runs:
        write_text(folder / f"{run.cycle}_{run.controller}.csv", trajectory_csv(run))
    write_text(folder / "compare.json", json_text({"runs": list(rows)}))
    missing = _missing("matplotlib")
    if missing:
        return [
            f"{folder}: trajectories (CSV) and compare.json written; no pictures and no report: "
            f"{missing} is not installed ({PLOT_EXTRA})"
        ]
    pictures = _pictures(runs)
    for cycle, picture in pictures.items():
        write_bytes(folder / f"{cycle}.png", picture)
    write_text(folder / "compare.html", comparison_html(runs, rows, settings, pictures))
    return [f"{folder / 'compare.html'} written, with pictures, trajectories and compare.json"]


def comparison_html(
    runs: Sequence[Run],
    rows: Sequence[dict[str, Any]],
    settings: ControllerSettings,
    pictures: Mapping[str, bytes] | None = None,
) -> str:
    """Return the report; its pictures are drawn if not given.

    Raises
    ------
    InputError
        If matplotlib is not installed.
    """
    missing = _missing("matplotlib")
    if missing:
        raise InputError(f"the report needs {missing}: {PLOT_EXTRA}")
    from qpmpc.report.compare_html import compare_html

    return compare_html(runs, rows, settings, _pictures(runs) if pictures is None else pictures)


def _pictures(runs: Sequence[Run]) -> dict[str, bytes]:
    from qpmpc.report.trajectories import draw_trajectories

    return {
        cycle: draw_trajectories([run for run in runs if run.cycle == cycle])
        for cycle in dict.fromkeys(run.cycle for run in runs)
    }


def write_cycle(cycle: Cycle, folder: Path) -> list[str]:
    """Draw a cycle; returns remarks."""

    def draw() -> bytes:
        from qpmpc.report.cycle_picture import draw_cycle

        return draw_cycle(cycle)

    file = folder / f"cycle_{cycle.name}.png"
    return _write_picture(file, draw) or [f"{file} written"]


def write_drive(drive: Drive, file: Path) -> list[str]:
    """Write a drive as CSV, and a picture beside it; returns remarks."""

    def draw() -> bytes:
        from qpmpc.report.drive_picture import draw_drive

        return draw_drive(drive)

    write_text(file, cycle_csv(drive.cycle))
    return [f"{file} written", *_write_picture(file.with_suffix(".png"), draw)]


def write_trips(trips: Sequence[Cycle], folder: Path) -> list[str]:
    """Write trips as CSV, and a picture if it is a single one; returns remarks."""
    for trip in trips:
        write_text(folder / f"{trip.name}.csv", cycle_csv(trip))
    if len(trips) > 1:
        return [f"{folder}: {len(trips)} trips written, {trips[0].name}.csv and so on"]
    return [f"{folder / trips[0].name}.csv written", *write_cycle(trips[0], folder)]


def write_trip_set(
    name: str, rows: Sequence[Row], shipped: Sequence[Row], folder: Path
) -> list[str]:
    """Draw the distributions of a set of trips; returns remarks."""

    def draw() -> bytes:
        from qpmpc.report.trip_set_picture import draw_trip_set

        return draw_trip_set(name, rows, shipped)

    file = folder / f"trips_{name}.png"
    return _write_picture(file, draw) or [f"{file} written"]


def write_pwa(vehicle: Vehicle, curves: Sequence[PwaCurve], folder: Path) -> list[str]:
    """Draw the piecewise-affine fits of a vehicle; returns remarks."""

    def draw() -> bytes:
        from qpmpc.report.pwa_picture import draw_pwa

        return draw_pwa(vehicle.name, curves)

    file = folder / f"pwa_{vehicle.name}.png"
    return _write_picture(file, draw) or [f"{file} written"]


def write_engine(mapped: "MappedVehicle", fuel: PwaCurve, file: Path) -> list[str]:
    """Draw a measured engine; returns remarks."""

    def draw() -> bytes:
        from qpmpc.report.engine_picture import draw_engine

        return draw_engine(mapped, fuel)

    return _write_picture(file, draw) or [f"{file} written"]


def _write_picture(file: Path, draw: Callable[[], bytes]) -> list[str]:
    missing = _missing("matplotlib")
    if missing:
        return [f"{file} not drawn: {missing} is not installed ({PLOT_EXTRA})"]
    write_bytes(file, draw())
    return []


def _missing(*modules: str) -> str:
    return next((module for module in modules if find_spec(module) is None), "")
