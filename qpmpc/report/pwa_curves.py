"""The piecewise-affine (PWA) models of a vehicle beside the curves they approximate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel, alpha_samples, battery_samples
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PwaCurve:
    """One curve, its fit, and their units and labels.

    Attributes
    ----------
    x, y : samples of the curve, shape (m,), in the units of the fit
    fit : the PWA function
    x_unit, y_unit : size of a shown unit in those of the fit
    y_unit_name : unit of the error, empty where there is none
    baseline : slope of a line that is subtracted from y before it is drawn, to show the curvature
    drawn_label : label of the difference drawn
    """

    title: str
    x_label: str
    y_label: str
    x: Floats
    y: Floats
    fit: PwaFit
    x_unit: float = 1.0
    y_unit: float = 1.0
    y_unit_name: str = ""
    baseline: float = 0.0
    drawn_label: str = ""

    @property
    def error(self) -> Floats:
        """Fit minus curve at the samples, shape (m,)."""
        return self.fit(self.x) - self.y


def pwa_curves(vehicle: Vehicle) -> list[PwaCurve]:
    """Return fuel, battery and cold multiplier with the fits that the controllers use."""
    model, line = PwaModel.of(vehicle), optimal_line(vehicle.engine)
    return [
        PwaCurve(
            title="fuel of the hot engine",
            x_label="engine power kW",
            y_label="fuel g/s",
            x=line.power_w,
            y=line.fuel_g_per_s,
            fit=model.fuel,
            x_unit=1e3,
            y_unit_name="g/s",
        ),
        PwaCurve(
            title=f"battery at SOC {vehicle.trip.soc_mean:g}",
            x_label="terminal power kW",
            y_label="internal power kW",
            x=battery_samples(vehicle)[0],
            y=battery_samples(vehicle)[1],
            fit=model.battery,
            x_unit=1e3,
            y_unit=1e3,
            y_unit_name="kW",
            baseline=1.0,
            drawn_label="loss: internal minus terminal kW",
        ),
        PwaCurve(
            title="cold multiplier alpha",
            x_label="coolant °C",
            y_label="alpha",
            x=alpha_samples(vehicle)[0],
            y=alpha_samples(vehicle)[1],
            fit=model.alpha,
        ),
    ]
