"""The base of all controllers: one observation in, one decision out, every second."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from math import isfinite
from numbers import Real
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import BaseModel

from qpmpc.controllers.monitor import NOTHING_WRONG, Flag, InputMonitor
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.controllers.settings import SettingsLike, as_settings
from qpmpc.errors import InputError, QpmpcError
from qpmpc.names import hint
from qpmpc.preview.stages import Preview
from qpmpc.qp.expectation import Expectation
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import Command

Progress = Callable[[int, int], None]
Receive = Callable[[int], Preview]  # of a second


class Decision(NamedTuple):
    """A command and its origin.

    `fallback` names the rung of the degradation ladder that was used, empty if none.
    `relaxation_gap` and `on_share` are nan for controllers without a relaxation, `certificate_g`,
    by how much the plan may at most be improved, for those that do not know it. `flags` says what
    was wrong in this second.
    """

    command: Command
    fallback: str = ""
    iterations: int = 0
    relaxation_gap: float = float("nan")
    on_share: float = float("nan")
    flags: Flag = NOTHING_WRONG
    certificate_g: float = float("nan")


NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


class Driver:
    """Common base of controllers and planners: name, trip and settings.

    Parameters
    ----------
    trip : to be driven
    settings : of all controllers, or some of them by dotted name

    Attributes
    ----------
    name : used in reports; letters, digits, dots, dashes, underscores. A class attribute is
        enough; without one it is derived from the name of the class
    solver_name : of the QP or program solved each second, empty where there is none
    Settings : pydantic model of its own settings, if any. With the name ``my-own`` its fields are
        set as ``my_own.FIELD``, and ``self.own_settings()`` returns their values.

    Raises
    ------
    InputError
        If the name has another form, or a setting is not allowed.
    """

    name: str = ""
    solver_name: str = ""
    expects: Expectation | None = None  # of the trip, once departed, where it plans that far
    soc_price_g: float | None = None  # of a unit of final SOC, once departed, where it knows
    solver_fails: bool = False  # by injection: what the solver returns this second is unusable
    Settings: ClassVar[type[BaseModel] | None] = None
    _has_name: ClassVar[bool] = False  # its own, or from a class above it

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls._has_name = cls._has_name or "name" in vars(cls)
        if not cls._has_name:
            cls.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", cls.__name__).lower()

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        if not NAME.fullmatch(self.name):
            raise InputError(
                f"{type(self).__name__}: name {self.name!r} must have 1 to 64 letters, digits, "
                "dots, dashes and underscores"
            )
        self.trip = trip
        self.settings = as_settings(settings)
        own = self.name.replace("-", "_")
        strange = [section for section in self.settings.others if section != own]
        if strange and isinstance(settings, Mapping):
            known = tuple(dict.fromkeys([*self.settings.sections(), own]))
            raise InputError(
                f"{self.name}: no settings {', '.join(strange)}{hint(strange[0], known)} here "
                f"names start with one of {', '.join(known)}, those of the vehicle are given to "
                "its trip"
            )

    def own_settings(self) -> BaseModel:
        """Return the values of `Settings`, with what the user set.

        Raises
        ------
        InputError
            If a value is not allowed.
        """
        if not (isinstance(self.Settings, type) and issubclass(self.Settings, BaseModel)):
            raise QpmpcError(f"{type(self).__name__}: Settings is no pydantic model")
        return self.settings.of(self.name.replace("-", "_"), self.Settings())


class Controller(Driver, ABC):
    """A causal controller; one instance belongs to one trip and drives it once.

    A subclass implements `step` and, if it has a memory or needs preparation, `depart`. `step` gets
    plausible measurements only (`InputMonitor`), and whatever it returns, the safety layer makes
    the command admissible.

    Parameters
    ----------
    trip, settings : as of `Driver`

    Attributes
    ----------
    implementation : language that the decisions are computed in
    remarks : what a user should know about the choices made for this run, one line each
    reservations : why the fuel of this run cannot be compared, one line each
    """

    implementation: str = "python"
    reads_fuel: bool = False  # the fuel injected, to learn from it
    # true if the commands are already admissible, or must be applied unchanged
    has_safety_layer: ClassVar[bool] = False
    # true if it checks its measurements itself, or needs none
    has_monitor: ClassVar[bool] = False
    # whether it decides from second to second, so that step times are meaningful
    decides_online: ClassVar[bool] = True
    # whether it is made of the truth, not of the trip as believed: the optimum, a replay
    knows_plant: ClassVar[bool] = False
    _under_way: bool | None = None  # None as long as __init__ has not run

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        super().__init__(trip, settings)
        self.remarks: list[str] = []
        self.reservations: list[str] = []
        self._lasting_remarks: list[str] = []
        self.safety = SafetyLayer(trip.plant)
        self.monitor = InputMonitor(trip.plant)
        self._under_way = False

    def depart(self, progress: Progress | None = None) -> None:
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
        """Run one second: check the measurements, `step`, then the safety layer."""
        if self._under_way is None:
            raise base_not_called(self)
        if not self._under_way:
            self.begin(self.trip)
        flags = NOTHING_WRONG
        if not self.has_monitor:
            seen, flags = self.monitor.checked(seen)
        decision = _decision_of(self.step(seen), self, seen.step)
        decision = decision._replace(flags=decision.flags | flags)
        if not self.has_safety_layer:
            decision = decision._replace(command=self.safety.admissible(decision.command, seen))
        self.monitor.commanded(decision.command)
        return decision

    def begin(self, trip: Trip, progress: Progress | None = None) -> None:
        """Start a run.

        Raises
        ------
        QpmpcError
            If the controller was made for another trip, or has driven and was not reset.
        """
        self.check_ready(trip)
        self._under_way = True
        self._lasting_remarks = list(self.remarks)
        self.monitor.forget()
        self.depart(progress)

    def forget(self) -> None:
        """Forget what a restart of the ECU under way would lose: here, the measurements."""
        self.monitor.forget()

    def inject(
        self, hearing: Callable[[Receive], Receive] | None, solver: bool = False
    ) -> frozenset[str]:
        """Prepare for faults inside, or without `hearing` go back to normal; see `Injection`.

        Parameters
        ----------
        hearing : from where previews are received, to where faulty ones are
        solver : whether `solver_fails` will be set

        Returns
        -------
        which of "preview" and "solver" there are
        """
        return frozenset()

    def check_ready(self, trip: Trip) -> None:
        """Check that the controller can start a run of this trip.

        Raises
        ------
        QpmpcError
            See `begin`.
        """
        if self._under_way is None:
            raise base_not_called(self)
        if not (trip if self.knows_plant else trip.as_believed).same_as(self.trip):
            raise QpmpcError(
                f"controller {self.name!r} was made for {self.trip!r} and cannot drive {trip!r}: "
                "make one for this trip"
            )
        if self._under_way:
            raise QpmpcError(
                f"controller {self.name!r} has driven already: call reset() before another run"
            )

    def reset(self) -> None:
        """Make ready for another run of the same trip, which begins with `depart`."""
        if self._under_way:
            self.remarks = list(self._lasting_remarks)  # those of the run are said
            self.reservations = []
        self._under_way = False


def _decision_of(made: object, controller: Controller, second: int) -> Decision:
    """Return what `step` made as a decision, if it can be obeyed."""
    decision = Decision(made) if isinstance(made, Command) else made
    if not isinstance(decision, Decision) or not isinstance(decision.command, Command):
        raise QpmpcError(
            f"{controller.name}: step returned {made!r} at {second} s, where a Command or a "
            "Decision is needed"
        )
    on: Any = decision.command.engine_on
    power_w: Any = decision.command.p_eng_w
    if not (isinstance(on, bool | np.bool_) and isinstance(power_w, Real) and isfinite(power_w)):
        raise QpmpcError(
            f"{controller.name}: step commands engine_on={on!r}, p_eng_w={power_w!r} at {second} "
            "s, where a bool and a finite number of watts are needed"
        )
    return decision


def base_not_called(made: object) -> QpmpcError:
    """Return the error for an object whose `__init__` has not called that of its base."""
    return QpmpcError(f"{type(made).__name__}.__init__ must call super().__init__(trip, settings)")
