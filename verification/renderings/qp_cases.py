"""What QPs are made from: states and plans met by `mh-qp` on the road, and random ones."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.qp.rows import VARS, Var
from qpmpc.simulate import simulate
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant

Floats = NDArray[np.float64]

# of plans that no trip made
PLAN_T_CL_DEGC, PLAN_FUEL_G_PER_S, PLAN_P_ENG_W = (20.0, 90.0), (0.0, 3.0), (0.0, 40e3)


@dataclass(frozen=True)
class QpCase:
    """What one QP is made from.

    Attributes
    ----------
    seen : step and state
    x : plan that it is expanded about, SI units, shape (n, VARS)
    """

    seen: Observation
    x: Floats


class _Cases:
    """Drives with `mh-qp` and keeps what its QPs are made from."""

    name, solver_name = "mh-qp", "osqp"

    def __init__(self, qp: MhQp, every: int) -> None:
        self.kept: list[QpCase] = []
        self._qp, self._every = qp, every

    def decide(self, seen: Observation) -> Decision:
        before = self._qp.planner.plan
        if seen.step % self._every == 0 and before is not None:
            shift = self._qp.planner.preview.shift()
            x = before.x if seen.step == 0 else before.x[shift]
            self.kept.append(QpCase(seen, x))
        return self._qp.decide(seen)


def recorded_cases(
    cycle: Cycle, vehicle: Vehicle, settings: ControllerSettings, every: int
) -> Iterator[QpCase]:
    """Cases met by `mh-qp` on the road: each `every`-th step, about the plan of the step before."""
    plant, truth = Plant(vehicle), Trace.of(cycle, vehicle)
    driver = _Cases(MhQp("mh-qp", plant, truth, truth, settings.mh_qp, settings.rule_based), every)
    simulate(cycle, driver, vehicle)
    yield from driver.kept


def random_cases(
    truth: Trace, vehicle: Vehicle, stages: int, count: int, seed: int
) -> Iterator[QpCase]:
    """Cases that no trip may ever meet: any step, any state, any plan to expand about."""
    rng = np.random.default_rng(seed)
    battery = vehicle.battery
    for _ in range(count):
        step = int(rng.integers(truth.steps))
        soc = float(rng.uniform(battery.soc_min, battery.soc_max))
        t_cl_degc = float(rng.uniform(*PLAN_T_CL_DEGC))
        x = np.zeros((stages, VARS))
        x[:, Var.SOC] = rng.uniform(battery.soc_min, battery.soc_max, stages)
        x[:, Var.T_CL] = rng.uniform(*PLAN_T_CL_DEGC, stages)
        x[:, Var.P_ENG] = rng.uniform(*PLAN_P_ENG_W, stages)
        x[:, Var.FUEL] = rng.uniform(*PLAN_FUEL_G_PER_S, stages)
        demand_w, speed_mps = float(truth.demand_w[step]), float(truth.speed_mps[step])
        yield QpCase(Observation(step, soc, t_cl_degc, False, demand_w, speed_mps), x)
