"""Injection: stands between the car and a controller, and alters what passes."""

from collections.abc import Callable

from qpmpc.controllers.base import Controller, Decision
from qpmpc.faults.alter import altered_preview, altered_signal
from qpmpc.faults.kinds import OF_PREVIEW, SIGNALS
from qpmpc.faults.models import Fault, Faults
from qpmpc.preview.stages import Preview
from qpmpc.trip import Observation
from qpmpc.vehicle.plant import Command

MISSED = "last command"  # drives where the controller is not called


class Injection:
    """A controller that drives under faults.

    The car stays as it is: plant, demand and speed are the truth. Preparations before departure are
    without faults.

    Parameters
    ----------
    controller : that is about to drive
    faults : of this run

    Raises
    ------
    InputError
        If a fault would begin after the arrival.

    Attributes
    ----------
    remarks : which faults cannot reach this controller
    """

    def __init__(self, controller: Controller, faults: Faults) -> None:
        faults.check_within(controller.trip.steps)
        self._controller, self._faults = controller, faults
        self._second: int | None = None
        self._seen: dict[str, list[object]] = {signal: [] for signal in SIGNALS}
        self._first: dict[int, Preview] = {}  # of each faulty preview
        self._made: list[Decision] = []
        kinds = {fault.kind for fault in faults}
        parts = controller.inject(self._hearing, "solver-failure" in kinds)
        idle = {f.what: self._without_effect(f, parts) for f in faults}
        self.remarks = [
            f"{controller.name}: no effect of {what}: it {reason}"
            for what, reason in idle.items()
            if reason
        ]

    def remove(self) -> None:
        """Leave the controller as it was."""
        self._controller.inject(None)
        self._controller.solver_fails = False

    def decide(self, seen: Observation) -> Decision:
        """Run the controller's second under its faults; see `Controller.decide`."""
        self._second = second = seen.step
        kinds = {fault.kind for fault in self._holding()}
        shown = self._altered(seen)
        self._controller.solver_fails = "solver-failure" in kinds
        if "reset" in kinds:
            self._controller.forget()
        if "missed-second" in kinds:
            command = self._made[-1].command if self._made else Command(False, 0.0)
            decision = Decision(command, MISSED)
        else:
            decision = self._controller.decide(shown)
            if "repeated-second" in kinds:
                first, decision = decision, self._controller.decide(shown)
                decision = decision._replace(flags=first.flags | decision.flags)
        self._made.append(decision)
        for fault in self._holding():
            if fault.kind == "late":
                before = self._made[max(second - int(fault.value or 0), 0)]
                decision = decision._replace(command=before.command)
        return decision

    def _holding(self) -> list[Fault]:
        """Faults of the present second."""
        second = self._second
        return [] if second is None else [fault for fault in self._faults if fault.holds(second)]

    def _altered(self, seen: Observation) -> Observation:
        """Return what the controller is shown."""
        for signal, history in self._seen.items():
            history.append(seen.step if signal == "second" else getattr(seen, signal))
        if not self._controller.decides_online:
            return seen
        shown: dict[str, object] = {}
        for fault in self._holding():
            if fault.signal:
                history = list(self._seen[fault.signal])
                field = "step" if fault.signal == "second" else fault.signal
                history[-1] = shown.get(field, history[-1])
                shown[field] = altered_signal(fault, seen.step, history)
        return Observation(**{**seen._asdict(), **shown})

    def _hearing(self, receive: Callable[[int], Preview]) -> Callable[[int], Preview]:
        """Return what a controller hears that would have heard `receive`.

        The navigation system knows the second, whatever the controller's clock says.
        """

        def heard(step: int) -> Preview:
            step = step if self._second is None else self._second
            preview = receive(step)
            for fault in self._holding():
                if fault.kind in OF_PREVIEW:
                    first = self._first.setdefault(id(fault), preview)
                    preview = altered_preview(fault, step, first, preview)
            return preview

        return heard

    def _without_effect(self, fault: Fault, parts: frozenset[str]) -> str:
        """Return why a fault cannot reach the controller; empty if it can."""
        if not self._controller.decides_online and (fault.signal or fault.kind == "reset"):
            return "replays commands, whatever it is shown"
        if fault.signal == "fuel_g" and not self._controller.reads_fuel:
            return "does not read the fuel injected"
        if fault.kind in OF_PREVIEW and "preview" not in parts:
            return "has no preview that faults can be injected into"
        if fault.kind == "solver-failure" and "solver" not in parts:
            return "has no solver that can fail"
        return ""
