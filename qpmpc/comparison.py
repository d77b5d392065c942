"""Several controllers on several cycles: run them, compare them, report."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any, overload

from rich.console import Console

from qpmpc.closed_loop import drive
from qpmpc.controllers.base import Controller, Progress
from qpmpc.controllers.receding_horizon import Planner
from qpmpc.controllers.settings import ControllerSettings, SettingsLike
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.files import check_file, json_text, write_text
from qpmpc.foreign_plant import ForeignCar
from qpmpc.registry import (
    PLANTS,
    ControllerLike,
    check_controllers,
    is_of_vehicle,
    make_controller,
)
from qpmpc.report.columns import compare_columns, notes
from qpmpc.report.table import print_rows
from qpmpc.report.write import comparison_html, write_comparison
from qpmpc.results import OPTIMUM, Run, compare_runs
from qpmpc.shown import shown
from qpmpc.simulation import CycleLike, VehicleLike, prepared, remark_idle_settings
from qpmpc.trip import Trip, as_trip
from qpmpc.vehicle import Vehicle, load_vehicle

DEFAULT_CONTROLLERS = ("rule-based", "mh-qp-paper", "mh-qp")
PRINTED_WIDTH = 200
ONE = (str, type, Controller, Planner)  # one controller, not several


class Runs(Sequence[Run]):
    """Runs with one vehicle, in the order in which they were made.

    Parameters
    ----------
    runs : any number
    settings : of the controllers, as they were run
    """

    def __init__(self, runs: Sequence[Run], settings: ControllerSettings | None = None) -> None:
        self._runs = list(runs)
        _one_vehicle([run.vehicle for run in self._runs])
        self.settings = settings or ControllerSettings()

    @overload
    def __getitem__(self, index: int) -> Run: ...
    @overload
    def __getitem__(self, index: slice) -> "Runs": ...
    def __getitem__(self, index: int | slice) -> "Run | Runs":
        if isinstance(index, slice):
            return Runs(self._runs[index], self.settings)
        return self._runs[index]

    def __len__(self) -> int:
        return len(self._runs)

    def rows(self) -> list[dict[str, Any]]:
        """Return the figures of each run, savings and distances among them; see `compare_runs`."""
        return compare_runs(self._runs)

    def remarks(self) -> list[str]:
        """Return the notes that a reader of the table needs, one line each."""
        rows = self.rows()
        said = dict.fromkeys(remark for row in rows for remark in row["remarks"])
        return [*notes(rows), *said]

    def to_html(self, file: str | os.PathLike[str]) -> Path:
        """Write the report: one page with table, pictures and settings that needs no other file.

        Raises
        ------
        InputError
            If there is no run, matplotlib is not installed, or the file cannot be written.
        """
        if not self._runs:
            raise InputError("there is no run to report")
        path = Path(file)
        check_file(path, "report")
        write_text(path, comparison_html(self._runs, self.rows(), self.settings))
        return path

    def to_json(self, file: str | os.PathLike[str]) -> Path:
        """Write the figures as ``{"runs": [...]}``."""
        path = Path(file)
        check_file(path, "JSON file")
        write_text(path, json_text({"runs": self.rows()}))
        return path

    def write(self, folder: str | os.PathLike[str]) -> list[str]:
        """Write report, pictures, trajectories (CSV) and figures (JSON); returns remarks."""
        return write_comparison(self._runs, self.rows(), self.settings, Path(folder))

    def __str__(self) -> str:
        if not self._runs:
            return "no runs"
        text, rows = StringIO(), self.rows()
        console = Console(file=text, width=PRINTED_WIDTH, highlight=False)
        print_rows(console, rows, compare_columns(rows), "cycle")
        return "\n".join([text.getvalue().rstrip(), *map(shown, self.remarks())])


def compare(
    cycles: CycleLike | Sequence[CycleLike],
    controllers: ControllerLike | Sequence[ControllerLike] = DEFAULT_CONTROLLERS,
    vehicle: VehicleLike | None = None,
    *,
    settings: SettingsLike | None = None,
    plant: str | None = None,
    figures: Mapping[str, Callable[[Run], float]] | None = None,
    next_job: Callable[[str], Progress] | None = None,
) -> Runs:
    """Drive every cycle with every controller, one after the other.

    Parameters
    ----------
    cycles, controllers : one or several, each as `simulate` takes it
    vehicle, settings : as of `simulate`
    plant : somebody else's that is driven in place of ours, by name: ``"fastsim"``,
        ``"fastsim-sonata"``. Controllers then believe in a vehicle that is derived from it, with
        the engine of `vehicle` if one is given; that name is also that of its own control
    figures : your own, by name with unit: functions of a run, for every controller's; they are
        columns of table and report, and in the JSON
    next_job : called with the title of each run; returns the function that takes its progress

    Raises
    ------
    InputError
        If a name, a file or a setting cannot be used, or one is given twice; before any run.
    """
    several = [cycles] if isinstance(cycles, str | os.PathLike | Cycle | Trip) else list(cycles)
    wanted = [controllers] if isinstance(controllers, ONE) else list(controllers)
    car: ForeignCar | None = None if plant is None else PLANTS.find(plant)
    check_controllers(wanted, own=car.name if car else "")
    if car is not None:
        vehicle, settings = _believed(car, several, vehicle, settings)
    trips: list[Trip] = []
    chosen = ControllerSettings()
    for cycle in several:
        trip, chosen = prepared(as_trip(cycle, vehicle, None), settings, wanted)
        if trip.cycle.name in [other.cycle.name for other in trips]:
            raise InputError(f"cycle {trip.cycle.name!r} is named twice")
        trips.append(trip)
    _one_vehicle([trip.vehicle for trip in trips])
    # before any run, so that what cannot run is refused in time
    of_first = [_made(what, trip, chosen, car) for trip in trips[:1] for what in wanted]
    made_already = [what for what in wanted if isinstance(what, Controller | Planner)]
    if len(trips) > 1 and made_already:
        raise InputError(
            f"controller {made_already[0].name!r} is made for one trip: give its class"
        )
    runs = []
    for trip in trips:  # one after the other, so that step times are not affected
        for i, what in enumerate(wanted):
            name = what if isinstance(what, str) else what.name
            report = next_job(f"{trip.cycle.name}, {name}") if next_job is not None else None
            made = of_first[i] if trip is trips[0] else _made(what, trip, chosen, car)
            remark_idle_settings(made, settings, wanted)
            foreign = None if car is None else car.plant(trip, made)
            run = drive(trip, made, progress=report, plant=foreign)
            if car is not None:
                of_car = car.remarks(trip.vehicle)
                if made.name == OPTIMUM:
                    of_car.append(f"{OPTIMUM} is the optimum of {trip.vehicle.name}, replayed on "
                                  f"the plant {car.name}: no bound there")  # fmt: skip
                run = replace(run, remarks=(*of_car, *run.remarks))
            if figures:
                run = replace(run, figures={what: float(f(run)) for what, f in figures.items()})
            runs.append(run)
    return Runs(runs, chosen)


def _made(
    what: ControllerLike, trip: Trip, settings: ControllerSettings, car: ForeignCar | None
) -> Controller:
    if car is not None and what == car.name:
        return car.own_control(trip.as_believed)
    return make_controller(what, trip, settings)


def _believed(
    car: ForeignCar,
    cycles: Sequence[CycleLike],
    engine_of: VehicleLike | None,
    settings: SettingsLike | None,
) -> tuple[Vehicle, SettingsLike | None]:
    """Return what controllers believe of a foreign car, and the settings that are left."""
    if any(isinstance(cycle, Trip) for cycle in cycles):
        raise InputError(f"a Trip has its vehicle: with the plant {car.name!r} give its cycle")
    of_vehicle: dict[str, object] = {}
    left = settings
    if isinstance(settings, Mapping):
        of_vehicle = {key: value for key, value in settings.items() if is_of_vehicle(key)}
        left = {key: value for key, value in settings.items() if key not in of_vehicle}
    if engine_of is not None and not isinstance(engine_of, Vehicle):
        engine_of = load_vehicle(engine_of)
    return car.vehicle(engine_of, of_vehicle), left


def _one_vehicle(vehicles: Sequence[Vehicle]) -> None:
    """Refuse several: tables and pictures tell runs apart by cycle and controller alone."""
    if any(vehicle != vehicles[0] for vehicle in vehicles):
        names = ", ".join(dict.fromkeys(vehicle.name for vehicle in vehicles))
        raise InputError(
            f"one comparison has one vehicle with one set of parameters, not several ({names}): "
            "make one for each"
        )
