"""The base of all controllers: one observation in, one decision out, every second."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple

from pydantic import BaseModel

from qpmpc.controllers.safety import SafetyLayer
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import QpmpcError
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import Command

Progress = Callable[[int, int], None]


class Decision(NamedTuple):
    """A command and its origin.

    `fallback` names the rung of the degradation ladder that was used, empty if none.
    `relaxation_gap` and `on_share` are nan for controllers without a relaxation.
    """

    command: Command
    fallback: str = ""
    iterations: int = 0
    relaxation_gap: float = float("nan")
    on_share: float = float("nan")


class Controller(ABC):
    """A causal controller; one instance belongs to one trip and drives it once.

    A subclass implements `step` and, if it has a memory or needs preparation, `depart`. Whatever
    `step` returns, the safety layer makes the command admissible.

    Parameters
    ----------
    trip : to be driven
    settings : of all controllers

    Attributes
    ----------
    name : used in reports; a class attribute is enough
    solver_name : of the QP or program solved each second, empty where there is none
    implementation : language that the decisions are computed in
    remarks : what a user should know about the choices made for this run, one line each
    Settings : pydantic model of the controller's own settings, if any. With the name ``my-own``
        its fields are set as ``my_own.FIELD``, and ``self.own_settings()`` returns their values.
    """

    name: str = "own"
    solver_name: str = ""
    implementation: str = "python"
    Settings: ClassVar[type[BaseModel] | None] = None
    # true if the commands are already admissible, or must be applied unchanged
    has_safety_layer: ClassVar[bool] = False
    # whether it decides from second to second, so that step times are meaningful
    decides_online: ClassVar[bool] = True
    _under_way: bool | None = None  # None as long as __init__ has not run

    def __init__(self, trip: Trip, settings: ControllerSettings | None = None) -> None:
        self.trip = trip
        self.settings = settings or ControllerSettings()
        self.remarks: list[str] = []
        self.safety = SafetyLayer(trip.plant, self.settings.rule_based.heat_power_w)
        self._under_way = False

    def depart(self, progress: Progress | None = None) -> None:  # noqa: B027
        """Get ready before the first second: set the memory, do slow preparations.

        Called once per run.

        Parameters
        ----------
        progress : called as progress(done, in all) by controllers that take over two seconds
        """

    @abstractmethod
    def step(self, seen: Observation) -> Command | Decision:
        """Choose the engine command of the coming second."""

    def decide(self, seen: Observation) -> Decision:
        """Run one second: `step`, then the safety layer."""
        if self._under_way is None:
            raise base_not_called(self)
        if not self._under_way:
            self.begin(self.trip)
        made = self.step(seen)
        decision = made if isinstance(made, Decision) else Decision(made)
        if self.has_safety_layer:
            return decision
        return decision._replace(command=self.safety.admissible(decision.command, seen))

    def begin(self, trip: Trip, progress: Progress | None = None) -> None:
        """Start a run.

        Raises
        ------
        QpmpcError
            If the controller was made for another trip, or has driven and was not reset.
        """
        if self._under_way is None:
            raise base_not_called(self)
        if not trip.same_as(self.trip):
            raise QpmpcError(
                f"controller {self.name!r} was made for {self.trip!r} and cannot drive {trip!r}: "
                "make one for this trip"
            )
        if self._under_way:
            raise QpmpcError(
                f"controller {self.name!r} has driven already: call reset() before another run"
            )
        self._under_way = True
        self.depart(progress)

    def reset(self) -> None:
        """Make ready for another run of the same trip, which begins with `depart`."""
        self._under_way = False

    def own_settings(self) -> BaseModel:
        """Return the values of `Settings`, with what the user set.

        Raises
        ------
        InputError
            If a value is not allowed.
        """
        if self.Settings is None:
            raise QpmpcError(f"{type(self).__name__} declares no Settings")
        return self.settings.of(self.name.replace("-", "_"), self.Settings())


def base_not_called(made: object) -> QpmpcError:
    """Return the error for an object whose `__init__` has not called that of its base."""
    return QpmpcError(f"{type(made).__name__}.__init__ must call super().__init__(trip, settings)")
