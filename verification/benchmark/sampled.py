"""QPs sampled from a closed loop with exact solutions, each with the one before it."""

from dataclasses import dataclass

import numpy as np

from qpmpc.controllers.qp_planner import Solve
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.rows import Var
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats
from qpmpc.solvers.names import make_solver
from qpmpc.trip import Trip
from qpmpc.verification.problems.recorder import record
from qpmpc.verification.renderings.kkt import objective

EXACT = 1e-9  # tolerance of the reference, PIQP, which drives


@dataclass(frozen=True)
class Started:
    """A QP, and what a controller starts it from: the last solution, shifted."""

    data: QpData
    primal: Floats
    dual: Floats


@dataclass(frozen=True)
class Sample:
    """A QP of the road.

    Attributes
    ----------
    structure : pattern
    before, now : of two seconds, one after the other; solvers that go on from what they have in
        memory solve the first untimed
    cost_g : least cost, g of fuel
    power_w : mean engine power of the first stage at that cost
    """

    structure: QpStructure
    before: Started
    now: Started
    cost_g: float
    power_w: float

    def cost_error_g(self, z: Floats) -> float:
        """Cost at z less the least; negative where z breaks rows."""
        return objective(self.now.data, z) / self.now.data.scaling.cost - self.cost_g

    def power_error_w(self, z: Floats) -> float:
        """How far the power of the first stage is off."""
        return abs(first_power_w(self.now.data, z) - self.power_w)

    def violation(self, z: Floats) -> float:
        """Largest excess over a bound, in solver units."""
        data = self.now.data
        row = self.structure.matrix_of(data.a_data) @ z
        return float(max((row - data.upper).max(), (data.lower - row).max(), 0.0))


def first_power_w(data: QpData, z: Floats) -> float:
    """Mean engine power of the first stage."""
    return float(data.scaling.primal(z)[Var.P_ENG])


def samples(trip: Trip, settings: ControllerSettings, count: int) -> list[Sample]:
    """Drive a trip with exact solutions and sample that many of its seconds, evenly spread."""
    loop = record(trip, settings, make_solver("piqp", EXACT))
    road = loop.on_the_road
    found = []
    for k in np.unique(np.linspace(1, len(road) - 1, count).astype(int)):
        before, now, solution = _started(road[k - 1]), _started(road[k]), road[k].solution
        if before is None or now is None or not solution.usable:
            continue
        least = objective(now.data, solution.primal) / now.data.scaling.cost
        power_w = first_power_w(now.data, solution.primal)
        found.append(Sample(loop.structure, before, now, least, power_w))
    return found


def _started(solve: Solve) -> Started | None:
    if solve.primal is None or solve.dual is None:
        return None
    return Started(solve.data, solve.primal, solve.dual)
