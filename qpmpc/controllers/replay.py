"""Replay of a plan made for the whole trip, such as dynamic programming's."""

from abc import abstractmethod
from collections.abc import Sequence

from qpmpc.controllers.base import Controller, Progress
from qpmpc.trip import Observation
from qpmpc.vehicle.plant import Command


class Replay(Controller):
    """Plans all commands of a trip at departure and replays them whatever the plant does."""

    has_monitor = has_safety_layer = True  # a plan made with the plant itself is applied unchanged
    knows_plant = True
    decides_online = False
    _commands: Sequence[Command] = ()

    @abstractmethod
    def commands(self, progress: Progress | None) -> Sequence[Command]:
        """Plan the whole trip: one command per step."""

    def depart(self, progress: Progress | None = None) -> None:
        """Plan the whole trip."""
        self._commands = self.commands(progress)

    def step(self, seen: Observation) -> Command:
        """Return the command planned for this step."""
        return self._commands[seen.step]
