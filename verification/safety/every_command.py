"""One second of the plant under every command, with equations written independently."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from qpmpc.vehicle import Command, Vehicle
from qpmpc.verification.independent.equations import Equations, Floats

POWERS = 1001  # tried besides the engine off


@dataclass(frozen=True)
class Seconds:
    """Many seconds, each on its own: measured state, demand and speed; shape (n,) each."""

    soc: Floats
    t_cl_degc: Floats
    engine_on: Floats
    demand_w: Floats
    speed_mps: Floats


class Excess(NamedTuple):
    """Excess over the limits of battery power, SOC and coolant after the second; 0 if kept.

    Shape (n, commands) or (n,) each.
    """

    power_w: Floats
    soc: Floats
    t_cl_k: Floats


class EveryCommand:
    """The second under every command, the engine off first, then on from least to most power.

    Parameters
    ----------
    vehicle : parameters
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle, self._equations = vehicle, Equations(vehicle)
        engine = vehicle.engine
        powers_w = np.linspace(engine.power_min_w, engine.power_max_w, POWERS)
        self._p_eng_w = np.concatenate([[0.0], powers_w])
        self._on = np.concatenate([[0.0], np.ones(POWERS)])
        # the plant's fuel is linear between the points of its own table
        self._table_w = np.linspace(
            0.0, engine.power_max_w, int(np.ceil(engine.power_max_w / 50.0)) + 1
        )
        self._table_g_per_s = self._equations.fuel_g_per_s(self._table_w)

    def least(self, at: Seconds, found: Excess) -> Excess:
        """Return the least excess that a command of the grid has, in order of priority.

        Of SOC among the commands that exceed power by no more than `found` does; of the coolant
        among those of them that exceed SOC by no more.
        """
        every = self._excess(at, self._on[None], self._p_eng_w[None])
        power = np.where(every.power_w <= found.power_w[:, None], 0.0, np.inf)
        soc = np.where(every.soc <= found.soc[:, None], power, np.inf)
        return Excess(
            every.power_w.min(axis=1),
            (every.soc + power).min(axis=1),
            (every.t_cl_k + soc).min(axis=1),
        )

    def of(self, at: Seconds, commands: list[Command]) -> Excess:
        """Return the excess of one command for each second."""
        on = np.array([[float(c.engine_on)] for c in commands])
        p_eng_w = np.array([[c.p_eng_w] for c in commands])
        return Excess(*(each[:, 0] for each in self._excess(at, on, p_eng_w)))

    def _excess(self, at: Seconds, on: Floats, p_eng_w: Floats) -> Excess:
        battery, thermal = self._vehicle.battery, self._vehicle.thermal
        eq, engine = self._equations, self._vehicle.engine
        soc, t_cl = at.soc[:, None], at.t_cl_degc[:, None]
        demand = at.demand_w[:, None]
        # the current that just fills the battery in a second, and what the brakes leave to it
        filling = np.maximum(battery.soc_max - soc, 0.0) * eq.charge_c
        accepted = np.minimum(-eq.terminal_w(soc, -filling), battery.power_charge_max_w)
        asked = demand + battery.aux_power_w - p_eng_w
        braked = np.minimum(-accepted, asked + np.maximum(-demand, 0.0))
        p_bat = np.where(asked >= -accepted, asked, braked)
        power = _beyond(p_bat, -battery.power_charge_max_w, battery.power_discharge_max_w)
        after = soc - eq.internal_w(soc, p_bat) / eq.voltage_v(soc) / eq.charge_c
        fuel = np.interp(p_eng_w, self._table_w, self._table_g_per_s) * eq.alpha(t_cl)
        fuel = on * (fuel + engine.start_fuel_g * (1.0 - at.engine_on[:, None]))
        heat = (1.0 - thermal.exhaust_share) * (fuel * eq.lhv_j_per_g - p_eng_w * on)
        lost = eq.ua_w_per_k(at.speed_mps[:, None]) * (t_cl - thermal.t_amb_degc)
        lost = lost + eq.cabin_w(t_cl) + eq.radiator_w(t_cl)
        warmer = t_cl + (heat - lost) / thermal.heat_capacity_j_per_k
        return Excess(
            power,
            _beyond(after, battery.soc_min, battery.soc_max),
            _beyond(warmer, thermal.t_cl_min_degc, thermal.t_cl_max_degc),
        )


def _beyond(values: Floats, low: float, high: float) -> Floats:
    return np.maximum(np.maximum(low - values, values - high), 0.0)
