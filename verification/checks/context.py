"""Data shared by the checks: vehicles, cycles, and closed loops with all their QPs, made once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.qp_planner import Solve
from qpmpc.controllers.settings import ControllerSettings, MhQpSettings
from qpmpc.results import Run
from qpmpc.solvers.base import Floats
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.verification.problems.recorder import record

QUICK_CYCLES = ("nycc",)
FULL_CYCLES = ("nycc", "nedc-truncated")


@dataclass(frozen=True)
class Loop:
    """One closed loop of `mh-qp`.

    Attributes
    ----------
    settings, controller : of `mh-qp`; the controller as it was at arrival
    run : its trajectory
    solves : the QP of each time step, with its start and its solution
    """

    trip: Trip
    settings: MhQpSettings
    controller: MhQp
    run: Run
    solves: list[Solve]

    @property
    def name(self) -> str:
        """Name of the cycle."""
        return self.trip.cycle.name

    def x(self, step: int) -> Floats:
        """Solution of one step in SI units, shape (stages, variables)."""
        solve = self.solves[step]
        stages = self.controller.planner.preview.count
        return np.asarray(solve.solution.primal * solve.data.scaling.column).reshape(stages, -1)

    def sample(self, count: int) -> list[int]:
        """Steps spread evenly over the trip, the first and the last among them."""
        return [int(k) for k in np.linspace(0, self.trip.steps - 1, count)]


class Context:
    """Runs shared by all checks; each is computed on first use.

    Parameters
    ----------
    quick : fewer cycles and samples
    vehicle : that drives; the default one if None
    """

    def __init__(self, quick: bool, vehicle: Vehicle | None = None) -> None:
        self.quick, self._vehicle = quick, vehicle
        self.settings = ControllerSettings()
        self._loops: dict[str, Loop] = {}

    @property
    def cycles(self) -> tuple[str, ...]:
        """Names of the cycles on which closed loops are checked."""
        return QUICK_CYCLES if self.quick else FULL_CYCLES

    @cached_property
    def vehicle(self) -> Vehicle:
        """The vehicle that drives."""
        return self._vehicle or load_vehicle()

    @cached_property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The shipped cars whose curves differ: those of the paper's are the same."""
        return load_vehicle("prius-nimh"), load_vehicle("prius-liion")

    def trip(self, cycle: str) -> Trip:
        """A shipped cycle, driven by the vehicle."""
        return Trip(cycle, self.vehicle)

    def loop(self, cycle: str) -> Loop:
        """Closed loop of `mh-qp` with all its QPs."""
        if cycle not in self._loops:
            made = record(self.trip(cycle), self.settings)
            trip, settings = made.controller.trip, self.settings.mh_qp
            self._loops[cycle] = Loop(trip, settings, made.controller, made.run, made.on_the_road)
        return self._loops[cycle]

    @property
    def loops(self) -> list[Loop]:
        """The closed loops of all cycles."""
        return [self.loop(cycle) for cycle in self.cycles]
