"""How far a plan lies above its relaxed curves, which a change of the program may leave open."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.rows import Var
from qpmpc.vehicle.parameters import Vehicle

LEAST_SIZE_W = 1e3  # of the power that the gap is a share of


def relaxation_gap(
    vehicle: Vehicle, model: PwaModel, stages: Stages, x: NDArray[np.float64]
) -> float:
    """Return the slack of the relaxed inequalities at the applied stage, relative.

    (|F - F_pwa| LHV + |G - G_pwa|) / max(|F| LHV + |G|, 1 kW), where F_pwa and G_pwa are the
    relaxed curves at (E, sigma): zero when both inequalities are tight.

    Parameters
    ----------
    vehicle, model : of the program
    stages : of the plan
    x : its variables in SI units, shape (n, variables), columns as in `Var`
    """
    first, net_w = x[0], float(stages.net_w[0])
    p_eng, on = float(first[Var.P_ENG]), float(first[Var.ON])
    fuel, battery = model.fuel, model.battery
    least_fuel = float((fuel.slope * p_eng + fuel.intercept * on).max())
    off_w = float(stages.internal_off_w[0])
    on_part = battery.slope * (on * net_w - p_eng) + battery.intercept * on
    least_internal = float(on_part.max()) + (1.0 - on) * off_w
    lhv_j_per_g = vehicle.engine.lhv_j_per_g
    slack = abs(float(first[Var.FUEL]) - least_fuel) * lhv_j_per_g
    slack += abs(float(first[Var.INTERNAL]) - least_internal)
    size = abs(float(first[Var.FUEL])) * lhv_j_per_g + abs(float(first[Var.INTERNAL]))
    return slack / max(size, LEAST_SIZE_W)
