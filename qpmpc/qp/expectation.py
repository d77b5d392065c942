"""What a plan of the whole trip expects, to be held against what comes of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import Var
from qpmpc.trip import Trip


class Expectation(NamedTuple):
    """Of a trip, by the plan of departure.

    Attributes
    ----------
    fuel_g : sum of h alpha(T) F and of the fuel of starts
    soc_end : at arrival
    """

    fuel_g: float
    soc_end: float


def expectation(
    trip: Trip, layout: HorizonSettings, model: PwaModel, stages: Stages, x: NDArray[np.float64]
) -> Expectation | None:
    """Return what the plan of departure expects; None if it does not reach the arrival.

    Parameters
    ----------
    trip, layout, model : of the plan
    stages : its n stages
    x : its variables in SI units, shape (n, variables), columns as in `Var`
    """
    reaches = stages.duration_s.sum() >= min(trip.steps, trip.forecast.steps)
    if not reaches or not np.isfinite(x).all():
        return None
    about = Linearisation.about(x, trip.start.t_cl_degc, layout)
    fuel_g = float((stages.duration_s * model.alpha(about.t_cl_degc) * x[:, Var.FUEL]).sum())
    if x.shape[1] > Var.START:
        fuel_g += trip.vehicle.engine.start_fuel_g * float(x[:, Var.START].sum())
    return Expectation(fuel_g, float(x[-1, Var.SOC]))
