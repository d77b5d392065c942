"""The plant's maps as smooth CasADi functions: the same tables with rounded corners."""

from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import QpmpcError
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.table import Table

Expression = Any  # a CasADi expression, which has no types

FUEL_STEP_W = 500.0  # spacing of the fuel curve's points; the line itself is tabled finer
# half widths over which corners are rounded
FUEL_CORNER_W = 300.0
SOC_CORNER = 0.01
DIRECTION_CORNER_W = 200.0  # from the battery's charge to its discharge resistance
T_CL_CORNER_K = 0.2  # of alpha, thermostat and cabin heat


def casadi() -> ModuleType:
    """Import CasADi.

    Raises
    ------
    QpmpcError
        If it is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise QpmpcError(
            "the nonlinear reference needs CasADi, which is not installed: "
            "pip install 'qpmpc-iptm[verification]'"
        ) from error


class SmoothMaps:
    """Twice differentiable maps of one vehicle, to be called with CasADi expressions.

    Parameters
    ----------
    vehicle : parameters
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.line = line = optimal_line(vehicle.engine)
        maps = BatteryMaps(vehicle.battery)
        count = int(np.ceil(line.power_max_w / FUEL_STEP_W)) + 1
        power = np.linspace(0.0, line.power_max_w, count)
        self._fuel = RoundedTable(power, line.fuel(power), FUEL_CORNER_W)
        self._open_circuit = _over_soc(maps.open_circuit)
        self._discharge = _over_soc(maps.discharge)
        self._charge = _over_soc(maps.charge)

    def fuel_g_per_s(self, power_w: Expression) -> Expression:
        """f_fuel of the hot engine on its optimal line, engine on."""
        return self._fuel(power_w)

    def voltage_v(self, soc: Expression) -> Expression:
        """U_oc(SOC)."""
        return self._open_circuit(soc)

    def internal_w(self, soc: Expression, power_w: Expression) -> Expression:
        """G = U I, I = [U - sqrt(U^2 - 4 R P)] / (2 R), discharge positive (paper eq. 1)."""
        ca, voltage = casadi(), self.voltage_v(soc)
        share = 0.5 * (1.0 + ca.tanh(power_w / DIRECTION_CORNER_W))
        resistance = share * self._discharge(soc) + (1.0 - share) * self._charge(soc)
        # 2 P / (1 + sqrt(..)) is the same without the difference of nearly equal numbers
        return 2.0 * power_w / (1.0 + ca.sqrt(1.0 - 4.0 * resistance * power_w / voltage**2))

    def alpha(self, t_cl_degc: Expression) -> Expression:
        """Cold multiplier, paper eq. (5)."""
        cold = self.vehicle.cold_engine
        below = _positive_part(cold.hot_degc - t_cl_degc, T_CL_CORNER_K) / cold.span_k
        return 1.0 + cold.k * below**cold.exponent

    def radiator_w(self, t_cl_degc: Expression) -> Expression:
        """Heat through the radiator, which the thermostat opens over its span."""
        th = self.vehicle.thermal
        opening = _ramp(t_cl_degc, th.thermostat_open_degc, th.thermostat_span_k)
        return opening * th.radiator_w_per_k * (t_cl_degc - th.t_amb_degc)

    def cabin_w(self, t_cl_degc: Expression) -> Expression:
        """Heat taken by the cabin, faded in between two coolant temperatures."""
        th = self.vehicle.thermal
        span = th.cabin_heat_full_degc - th.cabin_heat_from_degc
        return th.cabin_heat_w * _ramp(t_cl_degc, th.cabin_heat_from_degc, span)


class RoundedTable:
    """Linear interpolation of a table, its corners rounded, its ends continued.

    y = y_0 + s_0 (x - x_0) + sum_i (s_i - s_{i-1}) r(x - x_i), with s_i the slopes and
    r(d) = (d + sqrt(d^2 + w^2)) / 2 a smooth positive part. A convex table stays convex; the
    error is at most w / 2 |s_i - s_{i-1}| at a corner and falls as 1 / distance from it.

    Parameters
    ----------
    x, y : table, shape (m,)
    width : w, in the unit of x
    """

    def __init__(self, x: NDArray[np.float64], y: NDArray[np.float64], width: float) -> None:
        slope = np.diff(y) / np.diff(x)
        self._start, self._value, self._slope = float(x[0]), float(y[0]), float(slope[0])
        self._corners = list(zip(x[1:-1].tolist(), np.diff(slope).tolist(), strict=True))
        self._width = width

    def __call__(self, x: Expression) -> Expression:
        """Evaluate at a CasADi expression or a number."""
        y = self._value + self._slope * (x - self._start)
        for corner, change in self._corners:
            y += change * _positive_part(x - corner, self._width)
        return y


def _over_soc(table: Table) -> RoundedTable:
    return RoundedTable(table.x, table.y, SOC_CORNER)


def _positive_part(x: Expression, width: float) -> Expression:
    return 0.5 * (x + casadi().sqrt(x**2 + width**2))


def _ramp(x: Expression, start: float, span: float) -> Expression:
    """0 up to `start`, 1 from `start + span`, linear between, with rounded corners."""
    up, down = x - start, x - start - span
    return (_positive_part(up, T_CL_CORNER_K) - _positive_part(down, T_CL_CORNER_K)) / span
