"""Battery as open-circuit voltage behind a resistance, paper eq. (1)."""

from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.vehicle.parameters import Battery, Vehicle
from qpmpc.vehicle.table import Table


class BatteryMaps:
    """Maps of one battery: U_oc(SOC), R(SOC, direction), current and internal power.

    Attributes
    ----------
    charge_c : capacity in ampere seconds
    """

    def __init__(self, battery: Battery) -> None:
        self.open_circuit = Table(battery.soc_grid, battery.open_circuit_v)
        self.discharge = Table(battery.soc_grid, battery.resistance_discharge_ohm)
        self.charge = Table(battery.soc_grid, battery.resistance_charge_ohm)
        self.charge_c = 3600.0 * battery.capacity_ah
        self._soc_grid = battery.soc_grid

    def energy_j(self, soc: float) -> float:
        """Energy of a unit of SOC about `soc`: U_oc(soc) times the capacity, in J."""
        return self.open_circuit.at(soc) * self.charge_c

    def energy_between_j(self, soc_low: float, soc_high: float) -> float:
        """Energy in the store between two SOC, C_bat int U_oc dSOC; negative the other way round.

        Exact for the tabulated U_oc, which is linear between its points.
        """
        inside = [soc for soc in self._soc_grid if soc_low < soc < soc_high]
        inside = inside or [soc for soc in reversed(self._soc_grid) if soc_high < soc < soc_low]
        soc = [soc_low, *inside, soc_high]
        volts = [self.open_circuit.at(each) for each in soc]
        return self.charge_c * float(np.trapezoid(volts, soc))

    def current_a(self, soc: float, power_w: float) -> float:
        """Current at terminal power, I = [U - sqrt(U^2 - 4 R P)] / (2 R), discharge positive.

        Beyond the most the battery can give, U^2/(4 R), the current stays at U/(2 R).
        """
        voltage = self.open_circuit.at(soc)
        table = self.discharge if power_w >= 0.0 else self.charge
        resistance = table.at(soc)
        root = voltage * voltage - 4.0 * resistance * power_w
        return (voltage - sqrt(max(root, 0.0))) / (2.0 * resistance)

    def power_to_reach_w(self, soc: float, soc_end: float, duration_s: float) -> float:
        """Terminal power, discharge positive, that leads from `soc` to `soc_end`.

        I (U - R I) with I = (soc - soc_end) C_bat / duration; in discharge no more than the
        battery can give, U^2/(4 R).
        """
        voltage = self.open_circuit.at(soc)
        current = (soc - soc_end) * self.charge_c / duration_s
        resistance = (self.discharge if current >= 0.0 else self.charge).at(soc)
        current = min(current, voltage / (2.0 * resistance))  # beyond it, power falls
        return current * (voltage - resistance * current)

    def internal_power_w(self, soc: ArrayLike, power_w: ArrayLike) -> NDArray[np.float64]:
        """Power drawn from the store, G = U_oc I = P + R I^2, for arrays.

        Parameters
        ----------
        soc, power_w : broadcastable arrays; power_w at the terminals, discharge positive

        Returns
        -------
        internal power in W; convex in power_w with slope 1 at zero
        """
        power = np.asarray(power_w, dtype=float)
        voltage = self.open_circuit(soc)
        resistance = np.where(power >= 0.0, self.discharge(soc), self.charge(soc))
        root = np.sqrt(np.maximum(voltage**2 - 4.0 * resistance * power, 0.0))
        return np.asarray(voltage * (voltage - root) / (2.0 * resistance))


def derating_remark(vehicle: Vehicle) -> str:
    """Say what the cold leaves of the battery's power limits; empty where that is all."""
    share = vehicle.battery_power_share
    if share == 1.0:
        return ""
    return (
        f"the battery's power limits are {100.0 * share:.3g} % of the rated ones, "
        f"{vehicle.battery_discharge_max_w / 1e3:.3g} kW and "
        f"{vehicle.battery_charge_max_w / 1e3:.3g} kW of charge: it is taken to be at "
        f"{vehicle.thermal.t_amb_degc:g} °C, as the air, for the whole trip"
    )
