"""The controller's piecewise-affine model of a vehicle: fuel, battery, cold multiplier."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.pwa.fit import PwaFit, fit_convex
from qpmpc.pwa.learned_fuel import LearnedFuel
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine, alpha, optimal_line
from qpmpc.vehicle.engine_parameters import ColdEngine, Engine
from qpmpc.vehicle.parameters import Battery, Vehicle

BATTERY_STEP_W = 25.0
ALPHA_STEP_K = 0.05
ALPHA_COLDEST_DEGC = -20.0
ALPHA_HOTTEST_DEGC = 95.0
FITS_KEPT = 32  # of each curve: vehicles that differ elsewhere, in the weather say, share them


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
    battery : terminal power W -> internal power W at the trip's mean SOC
    alpha : coolant degC -> cold multiplier
    battery_energy_j : energy of a unit of SOC at the trip's mean SOC
    line : the optimal line that `fuel` fits
    """

    fuel: PwaFit
    battery: PwaFit
    alpha: PwaFit
    battery_energy_j: float
    line: OptimalLine

    @classmethod
    def of(
        cls, vehicle: Vehicle, tolerances: PwaTolerances | None = None, learning: bool = False
    ) -> "PwaModel":
        """Fit the PWA curves of a vehicle; `learning`: that of fuel is a `LearnedFuel`'s first."""
        tol = tolerances or PwaTolerances()
        if learning:
            fuel = learned_fuel(vehicle, tol).curve
        else:
            fuel = _fuel(vehicle.engine, tol.fuel_g_per_s, tol.fuel_knee_w)
        soc = vehicle.trip.soc_mean
        return cls(
            fuel=fuel,
            battery=_battery(
                vehicle.battery, *_limits_w(vehicle), soc, tol.battery_w, tol.battery_share
            ),
            alpha=_alpha(vehicle.cold_engine, *_alpha_range_degc(vehicle), tol.alpha),
            battery_energy_j=BatteryMaps(vehicle.battery).energy_j(soc),
            line=optimal_line(vehicle.engine),
        )


def learned_fuel(vehicle: Vehicle, tol: PwaTolerances) -> LearnedFuel:
    """Return what learns the fuel curve of a vehicle."""
    line = optimal_line(vehicle.engine)
    allowed = _allowed_g_per_s(line, tol.fuel_g_per_s, tol.fuel_knee_w)
    return LearnedFuel(vehicle.engine, vehicle.cold_engine, line, allowed)


def _allowed_g_per_s(
    line: OptimalLine, tolerance_g_per_s: float, knee_w: float
) -> NDArray[np.float64]:
    return tolerance_g_per_s * np.maximum(line.power_w / knee_w, 1.0) ** 2


@lru_cache(maxsize=FITS_KEPT)
def _fuel(engine: Engine, tolerance_g_per_s: float, knee_w: float) -> PwaFit:
    line = optimal_line(engine)
    allowed = _allowed_g_per_s(line, tolerance_g_per_s, knee_w)
    return fit_convex(line.power_w, line.fuel_g_per_s, allowed)


@lru_cache(maxsize=FITS_KEPT)
def _battery(
    battery: Battery,
    low_w: float,
    high_w: float,
    soc: float,
    tolerance_w: float,
    share: float,
) -> PwaFit:
    power, internal = _battery_samples(battery, low_w, high_w, soc)
    allowed = tolerance_w + share * np.abs(power)
    return fit_convex(power, internal, allowed, interpolation_error=_curvature_error(internal))


@lru_cache(maxsize=FITS_KEPT)
def _alpha(cold: ColdEngine, coldest: float, hottest: float, tolerance: float) -> PwaFit:
    temperature, multiplier = _alpha_samples(cold, coldest, hottest)
    error = _curvature_error(multiplier)
    return fit_convex(temperature, multiplier, tolerance, interpolation_error=error)


def battery_samples(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample terminal power (W) -> internal power (W) over the battery's power range."""
    return _battery_samples(vehicle.battery, *_limits_w(vehicle), vehicle.trip.soc_mean)


def _limits_w(vehicle: Vehicle) -> tuple[float, float]:
    """Least and greatest terminal power at the trip's ambient temperature."""
    return -vehicle.battery_charge_max_w, vehicle.battery_discharge_max_w


def _battery_samples(
    battery: Battery, low_w: float, high_w: float, soc: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = int(np.ceil((high_w - low_w) / BATTERY_STEP_W)) + 1
    power = np.linspace(low_w, high_w, count)
    return power, BatteryMaps(battery).internal_power_w(soc, power)


def alpha_samples(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample coolant temperature (degC) -> alpha, from below any start to above the thermostat."""
    return _alpha_samples(vehicle.cold_engine, *_alpha_range_degc(vehicle))


def _alpha_range_degc(vehicle: Vehicle) -> tuple[float, float]:
    start = vehicle.trip.t_cl_init_degc
    coldest = min(ALPHA_COLDEST_DEGC, vehicle.thermal.t_amb_degc, start)
    return coldest, max(ALPHA_HOTTEST_DEGC, start)


def _alpha_samples(
    cold: ColdEngine, coldest: float, hottest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = int(np.ceil((hottest - coldest) / ALPHA_STEP_K)) + 1
    temperature = np.linspace(coldest, hottest, count)
    return temperature, alpha(cold, temperature)


def _curvature_error(samples: NDArray[np.float64]) -> float:
    """Bound |f - linear interpolation| of a smooth curve, max |f''| dx^2 / 8, by differences.

    A kink in f'' at a sample (as at the battery's zero power) is inside the bound, because the
    second difference there lies between those of both sides.
    """
    return float(np.max(np.abs(np.diff(samples, 2)))) / 8.0
