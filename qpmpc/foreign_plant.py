"""A plant that somebody else wrote, in place of ours: what a comparison needs of it.

Controllers go on believing in a `Vehicle`, which is derived from the foreign car; what they command
is carried out by the foreign car, and what it made of it is what they are judged by.
"""

from collections.abc import Mapping
from typing import Any, Protocol

from qpmpc.controllers.base import Controller
from qpmpc.trip import Trip
from qpmpc.vehicle import Command, PlantState, StepFlows, Vehicle


class ForeignPlant(Protocol):
    """One trip on a foreign car."""

    def initial_state(self) -> PlantState:
        """Return the state at departure."""

    def step(
        self, state: PlantState, command: Command, demand_w: float, speed_mps: float
    ) -> tuple[PlantState, StepFlows]:
        """Advance one second of the trip, as `qpmpc.vehicle.Plant` does; each second once."""

    def account(self) -> dict[str, Any]:
        """Return what it did not obey and all else a reader must know, as plain data.

        Its ``name`` is that of the car.
        """

    def remarks(self) -> tuple[str, ...]:
        """Return the same in lines."""

    def reservations(self) -> tuple[str, ...]:
        """Return why the fuel of this run cannot be compared with that of others, if so."""


class ForeignCar(Protocol):
    """A foreign car: the target of a name in `qpmpc.registry.PLANTS`.

    Attributes
    ----------
    name : of the car, and of its own control among the controllers
    """

    name: str

    def vehicle(self, engine_of: Vehicle | None, settings: Mapping[str, object]) -> Vehicle:
        """Return what controllers believe.

        Parameters
        ----------
        engine_of : a vehicle whose engine they believe in; the car's own if None
        settings : of the vehicle, by dotted name

        Raises
        ------
        InputError
            If a setting has no effect with this plant.
        """

    def own_control(self, trip: Trip) -> Controller:
        """Return the control that the car comes with, as a controller of this trip."""

    def remarks(self, vehicle: Vehicle) -> list[str]:
        """Say what every run on it rests on, given what controllers believe."""

    def plant(self, trip: Trip, controller: Controller) -> ForeignPlant:
        """Return the plant for one run of a controller."""
