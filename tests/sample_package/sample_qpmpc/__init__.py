"""One name of each kind."""

from pathlib import Path

from pydantic import BaseModel

import qpmpc
from qpmpc.solvers.osqp import Osqp
from qpmpc.verification.checks import Check, Group

HERE = Path(__file__).parent
CAR, HILL = HERE / "car.toml", HERE / "hill.csv"


class ThresholdSettings(BaseModel):
    on_w: float = 9000.0


class Threshold(qpmpc.Controller):
    """The engine carries every demand above a threshold."""

    name = "sample-threshold"
    Settings = ThresholdSettings

    def step(self, seen):
        return qpmpc.Command(seen.demand_w > self.own_settings().on_w, seen.demand_w)


class Steady(qpmpc.Planner):
    """Plans the engine on at 6 kW for three seconds to come."""

    name = "sample-steady"

    def plan(self, seen):
        return qpmpc.Plan.of_means([1.0] * 3, [6000.0] * 3)


class Solver(Osqp):
    """OSQP under another name."""

    name = "sample-solver"


def two_and_two(context):
    yield Check("Two and two", "They make four.", 0.0, abs(2 + 2 - 4), "", "")


CHECK = Group("Arithmetic", (two_and_two,))
