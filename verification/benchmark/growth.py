"""Time of one step over the number of stages: it must grow linearly."""

from time import perf_counter
from typing import Any

import numpy as np

from qpmpc.controllers.settings import MhQpSettings
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.stage_qp import StageQp
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Trip
from qpmpc.vehicle.parameters import Vehicle

STAGES = (5, 10, 20, 50, 100, 200, 500, 1000, 2000)
REPETITIONS = 20


def growth(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Time data update and solve of full-trip QPs at 1 Hz of growing length.

    The trip is WLTC class 3b, repeated when it ends.

    Returns
    -------
    one row per length: stages, update_ms, solve_ms (medians, ms)
    """
    settings = MhQpSettings()
    trace = Trip("wltc-3b", vehicle).truth
    net, speed = trace.battery_side_w(vehicle), trace.speed_mps
    off = trace.internal_off_w(vehicle)
    model = PwaModel.of(vehicle, settings.pwa)
    rows = []
    for count in STAGES:
        at = np.arange(count) % trace.steps
        each = np.ones(count)
        stages = Stages(each, net[at], speed[at], off[at], each, 0.0 * each, 0.0 * each)
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
        rows.append(
            {
                "stages": count,
                "update_ms": float(np.median(update)) * 1e3,
                "solve_ms": float(np.median(solve)) * 1e3,
            }
        )
    return rows
