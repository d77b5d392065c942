"""Inputs of QPs: states and plans from closed loops of `mh-qp`, and random ones."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.closed_loop import drive
from qpmpc.controllers.base import Decision
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.qp_planner import QpPlan, Solve
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.rows import Var, table_of
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import PlantState

Floats = NDArray[np.float64]

# of plans that no trip made
PLAN_T_CL_DEGC, PLAN_FUEL_G_PER_S, PLAN_P_ENG_W = (20.0, 90.0), (0.0, 3.0), (0.0, 40e3)


@dataclass(frozen=True)
class QpCase:
    """The input of one QP.

    Attributes
    ----------
    seen : step and state
    x : plan that it is expanded about, SI units, shape (n, variables)
    """

    seen: Observation
    x: Floats


def recorded_cases(trip: Trip, settings: ControllerSettings, every: int) -> Iterator[QpCase]:
    """Cases of `mh-qp` in closed loop: each `every`-th step, about the previous step's plan."""
    kept: list[QpCase] = []
    before: QpPlan | None = None  # the last plan, when the QP of this second is solved

    def remember(solve: Solve) -> None:
        nonlocal before
        before = driver.planner.last

    def keep(seen: Observation, _: Decision) -> None:
        if seen.step % every == 0 and before is not None:
            shift = driver.planner.preview.shift()
            kept.append(QpCase(seen, before.x if seen.step == 0 else before.x[shift]))

    driver = MhQp(trip, settings, on_solve=remember)
    drive(trip, driver, on_step=keep)
    yield from kept


def random_cases(trip: Trip, stages: int, count: int, seed: int) -> Iterator[QpCase]:
    """Cases that may occur in no trip: any step, any state, any plan to expand about."""
    rng = np.random.default_rng(seed)
    battery, variables = trip.vehicle.battery, table_of(trip.vehicle.engine).variables
    for _ in range(count):
        step = int(rng.integers(trip.steps))
        soc = float(rng.uniform(battery.soc_min, battery.soc_max))
        t_cl_degc = float(rng.uniform(*PLAN_T_CL_DEGC))
        running = bool(rng.integers(2))
        x = np.zeros((stages, len(variables)))
        x[:, Var.SOC] = rng.uniform(battery.soc_min, battery.soc_max, stages)
        x[:, Var.T_CL] = rng.uniform(*PLAN_T_CL_DEGC, stages)
        x[:, Var.P_ENG] = rng.uniform(*PLAN_P_ENG_W, stages)
        x[:, Var.FUEL] = rng.uniform(*PLAN_FUEL_G_PER_S, stages)
        yield QpCase(trip.observation(step, PlantState(soc, t_cl_degc, running)), x)
