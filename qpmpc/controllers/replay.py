"""Replay of a plan made for the whole trip, such as dynamic programming's."""

from collections.abc import Sequence

from qpmpc.controllers.base import Decision, Observation
from qpmpc.vehicle.plant import Command


class Replay:
    """Gives the planned command of each step, whatever the plant does.

    Parameters
    ----------
    name : under which results are reported
    commands : one a step
    """

    solver_name = ""

    def __init__(self, name: str, commands: Sequence[Command]) -> None:
        self.name = name
        self._commands = commands

    def decide(self, seen: Observation) -> Decision:
        """Return the command planned for this step."""
        return Decision(self._commands[seen.step])
