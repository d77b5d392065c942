"""Engine: fuel map, optimal operating line, cold multiplier."""

from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.errors import InputError
from qpmpc.vehicle.engine_parameters import ColdEngine, Engine
from qpmpc.vehicle.table import Table

Floats = NDArray[np.float64]

LINE_STEP_W = 50.0
MAP_STEP_RPM = 5.0
LINES_KEPT = 32  # some 80 KiB each


def fuel_power_w(engine: Engine, speed_rpm: ArrayLike, power_w: ArrayLike) -> NDArray[np.float64]:
    """Fuel power of the hot engine at any speed and power.

    P_fuel = 1e3 K(N) V_L N / 60 + P_eng / eta_ind, the fuel map of paper eq. (5).

    Parameters
    ----------
    speed_rpm, power_w : broadcastable arrays

    Returns
    -------
    fuel power in W, same shape; the torque limit is not checked here
    """
    speed = np.asarray(speed_rpm, dtype=float)
    friction = np.interp(
        speed, _of_map(engine.friction_speed_rpm), _of_map(engine.friction_kj_per_rev_l)
    )
    pumping_w = 1e3 * friction * _of_map(engine.displacement_l) * speed / 60.0
    return np.asarray(pumping_w + np.asarray(power_w) / _of_map(engine.indicated_efficiency))


Value = TypeVar("Value")


def _of_map(value: Value | None) -> Value:
    if value is None:
        raise InputError("this engine is given by its optimal line: it has no map over speed")
    return value


class OptimalLine:
    """Optimal operating line: at each power the speed of least fuel within the torque limit.

    Of an engine that is given by its line, that line; between its points fuel is linear.

    Attributes
    ----------
    power_w, speed_rpm, torque_nm, fuel_g_per_s : arrays along the line, shape (m,); speed and
        torque are NaN where an engine's line comes without speed
    fuel : `Table` power_w -> fuel_g_per_s of the hot engine, engine on
    power_max_w : rated power
    """

    def __init__(self, engine: Engine) -> None:
        count = int(np.ceil(engine.power_max_w / LINE_STEP_W)) + 1
        self.power_w = np.linspace(0.0, engine.power_max_w, count)
        if engine.line_power_w is None:
            self.speed_rpm, self.fuel_g_per_s = self._from_map(engine)
        else:
            self.speed_rpm, self.fuel_g_per_s = self._given(engine)
        self.torque_nm = self.power_w / (self.speed_rpm * (2.0 * np.pi / 60.0))
        self.fuel = Table(self.power_w, self.fuel_g_per_s)
        self.power_max_w = engine.power_max_w

    def _given(self, engine: Engine) -> tuple[Floats, Floats]:
        power_w = np.array(engine.line_power_w)
        if engine.line_speed_rpm is None:
            speed_rpm = np.full_like(self.power_w, np.nan)
        else:
            speed_rpm = np.interp(self.power_w, power_w, engine.line_speed_rpm)
        return speed_rpm, np.interp(self.power_w, power_w, np.array(engine.line_fuel_g_per_s))

    def _from_map(self, engine: Engine) -> tuple[Floats, Floats]:
        friction_rpm, torque_rpm = (
            _of_map(engine.friction_speed_rpm),
            _of_map(engine.torque_speed_rpm),
        )
        low = max(friction_rpm[0], torque_rpm[0])
        high = min(friction_rpm[-1], torque_rpm[-1])
        speed = np.arange(low, high + MAP_STEP_RPM, MAP_STEP_RPM).clip(max=high)
        omega = speed * (2.0 * np.pi / 60.0)
        limit_w = np.interp(speed, torque_rpm, _of_map(engine.torque_max_nm)) * omega
        if limit_w.max() < engine.power_max_w * (1.0 - 1e-3):
            raise InputError(
                f"engine.power_max_w: {engine.power_max_w:.0f} W is above the "
                f"{limit_w.max():.0f} W that torque_max_nm allows"
            )
        fuel_w = fuel_power_w(engine, speed[None, :], self.power_w[:, None])
        reachable = limit_w[None, :] >= np.minimum(self.power_w, limit_w.max())[:, None]
        best = np.where(reachable, fuel_w, np.inf).argmin(axis=1)
        fuel_g_per_s = fuel_w[np.arange(len(best)), best] / engine.lhv_j_per_kg * 1e3
        return speed[best], fuel_g_per_s


@lru_cache(maxsize=LINES_KEPT)
def optimal_line(engine: Engine) -> OptimalLine:
    """Return the optimal line of an engine, kept for the next user; its arrays are read-only.

    Raises
    ------
    InputError
        If the torque limit does not allow the rated power.
    """
    line = OptimalLine(engine)
    for array in (line.power_w, line.speed_rpm, line.torque_nm, line.fuel_g_per_s):
        array.flags.writeable = False
    return line


def alpha(cold: ColdEngine, t_cl_degc: ArrayLike) -> NDArray[np.float64]:
    """Cold multiplier of fuel, alpha(T) = 1 + k ((T_hot - T)/span)^e below T_hot, else 1.

    Source: paper eq. (5) and its Fig. 2 for the shape. Array in, array out, dimensionless.
    """
    below = np.maximum(cold.hot_degc - np.asarray(t_cl_degc, dtype=float), 0.0)
    return 1.0 + cold.k * (below / cold.span_k) ** cold.exponent


def alpha_at(cold: ColdEngine, t_cl_degc: float) -> float:
    """`alpha` at one temperature (the plant's fast path)."""
    if t_cl_degc >= cold.hot_degc:
        return 1.0
    return 1.0 + cold.k * float(((cold.hot_degc - t_cl_degc) / cold.span_k) ** cold.exponent)
