"""What a controller sees and says: one observation in, one decision out, every second."""

from typing import NamedTuple, Protocol

from qpmpc.vehicle.plant import Command


class Observation(NamedTuple):
    """Measured at the start of a step; demand and speed are those of the step to come."""

    step: int
    soc: float
    t_cl_degc: float
    engine_on: bool
    demand_w: float
    speed_mps: float


class Decision(NamedTuple):
    """A command and how it came about.

    `fallback` names the rung of the degradation ladder that was used, empty if none.
    `relaxation_gap` and `sigma` are nan for controllers without a relaxation.
    """

    command: Command
    fallback: str = ""
    iterations: int = 0
    relaxation_gap: float = float("nan")
    sigma: float = float("nan")


class Controller(Protocol):
    """A causal controller; one instance drives one trip from its first step to its last."""

    name: str
    solver_name: str

    def decide(self, seen: Observation) -> Decision:
        """Choose the engine command of the coming step."""
