"""Time of one step over the number of stages: linear where a solver knows the structure."""

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np

from qpmpc.controllers.settings import MhQpSettings
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Status
from qpmpc.solvers.names import make_solver
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Trip
from qpmpc.vehicle.must_run import must_run
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.benchmark.candidates import RIVAL_TOLERANCE

STAGES = (5, 10, 20, 50, 100, 200, 500, 1000, 2000)
REPETITIONS = 20
OF_RIVALS = 3
ENOUGH_S = 0.5  # a rival whose solve takes longer is given no more stages


def growth(
    vehicle: Vehicle, settings: MhQpSettings, rivals: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Time data update and solve of full-trip QPs at 1 Hz of growing length.

    The trip is WLTC class 3b, repeated when it ends.

    Returns
    -------
    one row per length: stages, update_ms, solve_ms (medians, ms), and rivals_ms: of each that
    solved it, from cold to `RIVAL_TOLERANCE`, the best of `OF_RIVALS`, ms
    """
    left = list(rivals)
    trace = Trip("wltc-3b", vehicle).truth
    net, speed = trace.battery_side_w(vehicle), trace.speed_mps
    off = trace.internal_off_w(vehicle)
    model = PwaModel.of(vehicle, settings.pwa)
    rows = []
    for count in STAGES:
        at = np.arange(count) % trace.steps
        each = np.ones(count)
        must = must_run(vehicle, net[at], speed[at]).astype(float)
        p0, none = net[at], 0.0 * each
        stages = Stages(each, p0, speed[at], off[at], must, p0, off[at], each, none, none)
        about = Linearisation.constant(count, 60.0)
        qp = StageQp(vehicle, model, count, settings.qp, settings.scaling)
        solver = Osqp(settings.admm)
        solver.setup(qp.structure, qp.update(stages, 0.6, 60.0, about))
        update, solve = [], []
        for _ in range(REPETITIONS):
            start = perf_counter()
            data = qp.update(stages, 0.6, 60.0, about)
            update.append(perf_counter() - start)
            start = perf_counter()
            solver.solve(data, None, None)
            solve.append(perf_counter() - start)
        rivals_ms = {name: _rival_ms(name, qp.structure, data) for name in left}
        left = [name for name in left if (rivals_ms[name] or 0.0) < ENOUGH_S * 1e3]
        rows.append(
            {
                "stages": count,
                "update_ms": float(np.median(update)) * 1e3,
                "solve_ms": float(np.median(solve)) * 1e3,
                "rivals_ms": rivals_ms,
            }
        )
    return rows


def _rival_ms(name: str, structure: QpStructure, data: QpData) -> float | None:
    """Best time of a solve from cold; None where it fails."""
    solver = make_solver(name, RIVAL_TOLERANCE)
    solver.setup(structure, data)
    best = np.inf
    for _ in range(OF_RIVALS):
        found = solver.solve(data, None, None)
        if found.status is not Status.SOLVED:
            return None
        best = min(best, found.solve_s)
        if found.solve_s > ENOUGH_S:
            break
    return float(best) * 1e3
