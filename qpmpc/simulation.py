"""The usual entry point: simulate one run, given names or objects."""

import os
from collections.abc import Mapping

from qpmpc.closed_loop import OnStep, drive
from qpmpc.controllers.base import Controller, Progress
from qpmpc.controllers.receding_horizon import Planner
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.preview.forecast import Trace
from qpmpc.registry import ControllerLike, make_controller, split_settings
from qpmpc.results import Run
from qpmpc.trip import Trip, as_trip
from qpmpc.vehicle import Vehicle

CycleLike = str | os.PathLike[str] | Cycle | Trip
VehicleLike = str | os.PathLike[str] | Vehicle
SettingsLike = Mapping[str, object] | ControllerSettings


def simulate(
    cycle: CycleLike,
    controller: ControllerLike = "mh-qp",
    vehicle: VehicleLike | None = None,
    *,
    settings: SettingsLike | None = None,
    forecast: Trace | Cycle | None = None,
    on_step: OnStep | None = None,
    progress: Progress | None = None,
) -> Run:
    """Drive a cycle with a controller on the nonlinear plant.

    Parameters
    ----------
    cycle : a shipped name, a CSV file, a `Cycle`, or a `Trip`, which has its vehicle and forecast
    controller : a name, a class of controllers or planners, or one made for this trip
    vehicle : a shipped name, a TOML file or a `Vehicle`; the default one if None
    settings : of vehicle and controllers by dotted name, e.g. ``{"thermal.t_amb_degc": -15}``
    forecast : for the long horizon, instead of the truth
    on_step, progress : see `drive`

    Raises
    ------
    InputError
        If a name, a file or a setting cannot be used; one line with the reason and what is allowed.
    QpmpcError
        If the controller given belongs to another trip or has driven already.
    """
    trip, chosen = prepared(as_trip(cycle, vehicle, forecast), settings, [controller])
    made = make_controller(controller, trip, chosen)
    return drive(trip, made, on_step=on_step, progress=progress)


def prepared(
    trip: Trip, settings: SettingsLike | None, controllers: list[ControllerLike]
) -> tuple[Trip, ControllerSettings]:
    """Apply settings: return the trip with those of the vehicle, and those of the controllers.

    Raises
    ------
    InputError
        If a name or value is not allowed, or has no effect on an existing controller.
    """
    of_vehicle: dict[str, object] = {}
    chosen = ControllerSettings()
    if isinstance(settings, ControllerSettings):
        chosen = settings
    elif settings is not None:
        of_vehicle, chosen = split_settings(settings, controllers)
    made_already = all(isinstance(what, Controller | Planner) for what in controllers)
    if made_already and chosen != ControllerSettings():
        raise InputError(
            "settings have no effect on a controller that is made already: make it with them"
        )
    if of_vehicle:
        forecast = None if trip.forecast is trip.truth else trip.forecast
        trip = Trip(trip.cycle, trip.vehicle.with_settings(of_vehicle), forecast)
    return trip, chosen
