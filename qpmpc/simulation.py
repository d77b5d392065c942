"""The usual entry point: simulate one run, given names or objects."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qpmpc.closed_loop import OnStep, drive
from qpmpc.controllers.base import Controller, Progress
from qpmpc.controllers.receding_horizon import Planner
from qpmpc.controllers.settings import ControllerSettings, SettingsLike, as_settings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.faults.effects import effect, fuel_change
from qpmpc.faults.models import Faults, FaultsLike, as_faults
from qpmpc.preview.forecast import Trace
from qpmpc.registry import (
    ControllerLike,
    check_controllers,
    check_sections,
    make_controller,
    split_settings,
    without_effect,
)
from qpmpc.remarks import say_once
from qpmpc.results import Run
from qpmpc.trip import Trip, as_trip
from qpmpc.vehicle import Vehicle

CycleLike = str | os.PathLike[str] | Cycle | Trip
VehicleLike = str | os.PathLike[str] | Vehicle


def simulate(
    cycle: CycleLike,
    controller: ControllerLike = "mh-qp",
    vehicle: VehicleLike | None = None,
    *,
    settings: SettingsLike | None = None,
    forecast: Trace | Cycle | None = None,
    faults: FaultsLike | None = None,
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
    faults : a TOML file, or a list of mappings with the keys of `qpmpc.faults.models.Fault`, to be
        injected. The trip is then driven first without, then with each alone, then with all: the
        run returned, whose `faults` has the effect of each
    on_step, progress : see `drive`; `on_step` is called in the run returned

    Raises
    ------
    InputError
        If a name, a file or a setting cannot be used; one line with the reason and what is allowed.
    QpmpcError
        If the controller given belongs to another trip or has driven already.
    """
    check_controllers([controller])
    injected = None if faults is None else as_faults(faults)
    trip, chosen = prepared(as_trip(cycle, vehicle, forecast), settings, [controller])
    made = make_controller(controller, trip, chosen)
    remark_idle_settings(made, settings, [controller])
    if injected is None:
        return drive(trip, made, on_step=on_step, progress=progress)
    return _drive_under(injected, trip, made, on_step, progress)


def _drive_under(
    faults: Faults,
    trip: Trip,
    controller: Controller,
    on_step: OnStep | None,
    progress: Progress | None,
) -> Run:
    """Drive without faults, with each alone and with all, and compare."""
    faults.check_within(trip.steps)
    sets = [None, *(Faults([fault]) for fault in faults), faults]
    jobs = len(sets)
    runs: list[Run] = []
    for number, those in enumerate(sets):
        controller.reset()

        def report(done: int, total: int, before: int = number) -> None:
            if progress is not None:
                progress(before * total + done, jobs * total)

        on = on_step if number == jobs - 1 else None
        runs.append(drive(trip, controller, faults=those, on_step=on, progress=report))
    unfaulted, *each, together = runs
    return replace(
        together,
        faults={
            "unfaulted_fuel_soc_balanced_g": unfaulted.fuel_soc_balanced_g,
            **fuel_change(together, unfaulted),
            "each": [effect(f, run, unfaulted) for f, run in zip(faults, each, strict=True)],
        },
    )


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
    if isinstance(settings, Mapping):
        of_vehicle, chosen = split_settings(settings, controllers)
    else:
        chosen = as_settings(settings)
        check_sections(chosen, controllers)
    made_already = all(isinstance(what, Controller | Planner) for what in controllers)
    if made_already and (of_vehicle or chosen != ControllerSettings()):
        raise InputError(
            "settings have no effect on a controller that is made already: "
            "make it, and its trip, with them"
        )
    if of_vehicle:
        trip = trip.with_settings(of_vehicle)
    return trip, chosen


def remark_idle_settings(
    made: Controller, settings: SettingsLike | None, controllers: Sequence[ControllerLike]
) -> None:
    """Say which settings, if any, reach none of the controllers, here and in the run of one."""
    line = without_effect(settings, controllers) if isinstance(settings, Mapping) else ""
    if line:
        say_once(line)
        made.remarks.append(line)
