"""The controller's piecewise-affine model of a vehicle: fuel, battery, cold multiplier."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.pwa.fit import PwaFit, fit_convex
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine, alpha
from qpmpc.vehicle.parameters import Vehicle

BATTERY_STEP_W = 25.0
ALPHA_STEP_K = 0.05
ALPHA_COLDEST_DEGC = -20.0
ALPHA_HOTTEST_DEGC = 95.0


class PwaTolerances(BaseModel):
    """Largest PWA errors; the number of pieces follows from them: some tens at the least ones.

    Attributes
    ----------
    fuel_g_per_s, fuel_knee_w : fuel may be off by the first, and beyond this power, where the
        engine seldom runs, by the first times (P / knee)^2
    battery_w, battery_share : internal power may be off by the first plus a share of the power
    alpha : cold multiplier
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    fuel_g_per_s: Annotated[float, Field(ge=1e-5, le=10.0)] = 0.0015
    fuel_knee_w: Annotated[float, Field(ge=100.0, le=1e6)] = 20e3
    battery_w: Annotated[float, Field(ge=0.1, le=1e5)] = 6.0
    battery_share: Annotated[float, Field(ge=0.0, le=0.1)] = 0.006
    alpha: Annotated[float, Field(ge=1e-5, le=1.0)] = 0.001


@dataclass(frozen=True)
class PwaModel:
    """PWA curves of the QP.

    Attributes
    ----------
    fuel : hot engine on its optimal line, engine on: power W -> fuel g/s
    battery : terminal power W -> internal power W at the trip's initial SOC
    alpha : coolant degC -> cold multiplier
    battery_energy_j : energy of a unit of SOC at the trip's initial SOC
    line : the optimal line that `fuel` fits
    """

    fuel: PwaFit
    battery: PwaFit
    alpha: PwaFit
    battery_energy_j: float
    line: OptimalLine

    @classmethod
    def of(cls, vehicle: Vehicle, tolerances: PwaTolerances | None = None) -> "PwaModel":
        """Fit the PWA curves of a vehicle."""
        tol = tolerances or PwaTolerances()
        line, maps = OptimalLine(vehicle.engine), BatteryMaps(vehicle.battery)
        soc = vehicle.trip.soc_init
        power, internal = battery_samples(vehicle)
        temperature, multiplier = alpha_samples(vehicle)
        return cls(
            fuel=fit_convex(
                line.power_w,
                line.fuel_g_per_s,
                tol.fuel_g_per_s * np.maximum(line.power_w / tol.fuel_knee_w, 1.0) ** 2,
            ),
            battery=fit_convex(
                power,
                internal,
                tol.battery_w + tol.battery_share * np.abs(power),
                interpolation_error=_curvature_error(internal),
            ),
            alpha=fit_convex(
                temperature, multiplier, tol.alpha, interpolation_error=_curvature_error(multiplier)
            ),
            battery_energy_j=maps.energy_j(soc),
            line=line,
        )


def battery_samples(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample terminal power (W) -> internal power (W) over the battery's power range."""
    battery = vehicle.battery
    span = battery.power_discharge_max_w + battery.power_charge_max_w
    count = int(np.ceil(span / BATTERY_STEP_W)) + 1
    power = np.linspace(-battery.power_charge_max_w, battery.power_discharge_max_w, count)
    maps = BatteryMaps(battery)
    return power, maps.internal_power_w(vehicle.trip.soc_init, power)


def alpha_samples(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample coolant temperature (degC) -> alpha, from below any start to above the thermostat."""
    coldest = min(ALPHA_COLDEST_DEGC, vehicle.thermal.t_amb_degc, vehicle.trip.t_cl_init_degc)
    hottest = max(ALPHA_HOTTEST_DEGC, vehicle.trip.t_cl_init_degc)
    count = int(np.ceil((hottest - coldest) / ALPHA_STEP_K)) + 1
    temperature = np.linspace(coldest, hottest, count)
    return temperature, alpha(vehicle.cold_engine, temperature)


def _curvature_error(samples: NDArray[np.float64]) -> float:
    """Bound |f - linear interpolation| of a smooth curve, max |f''| dx^2 / 8, by differences.

    A kink in f'' at a sample (as at the battery's zero power) is inside the bound, because the
    second difference there lies between those of both sides.
    """
    return float(np.max(np.abs(np.diff(samples, 2)))) / 8.0
