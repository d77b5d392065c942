"""One second of the plant under every command, with equations written independently."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.safety import POWER_MARGIN_W, SOC_MARGIN, T_CL_MARGIN_K
from qpmpc.vehicle import Command, Vehicle
from qpmpc.vehicle.must_run import SPEED_ROUNDING_MPS
from qpmpc.verification.independent.equations import Equations, Floats

POWERS = 1001  # tried besides the engine off
WELL_INSIDE = 2.0  # margins of the safety layer


@dataclass(frozen=True)
class Seconds:
    """Many seconds, each on its own: state, road and engine before, shape (n,) each.

    Named as in `Observation`.
    """

    soc: Floats
    t_cl_degc: Floats
    engine_on: Floats
    demand_w: Floats
    speed_mps: Floats
    engine_for_s: Floats
    p_eng_before_w: Floats


class Excess(NamedTuple):
    """Excess over the limits of battery power, SOC and coolant after the second; 0 if kept.

    Infinite in power with the engine off where the car is too fast for that. A start has to keep
    them with the power that cranks the engine and without.

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
        self._on = np.concatenate([[0.0], np.ones(POWERS)])[None]
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
        every = self._excess(at, self._on, self._powers_w(at))
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

    def could_go_on(self, at: Seconds) -> NDArray[np.bool_]:
        """Whether some command that neither starts nor stops the engine stays well inside limits.

        By `WELL_INSIDE` times the margins of the safety layer; shape (n,).
        """
        every = self._excess(at, self._on, self._powers_w(at), WELL_INSIDE)
        kept = (every.power_w <= 0.0) & (every.soc <= 0.0) & (every.t_cl_k <= 0.0)
        return np.asarray((kept & (self._on == at.engine_on[:, None])).any(axis=1))

    def greatest_w(self, at: Seconds) -> Floats:
        """Greatest power of the engine: its own, or what its ramp allows less the layer's margin.

        Shape (n,).
        """
        engine = self._vehicle.engine
        ramped = at.engine_on * at.p_eng_before_w + engine.ramp_w_per_s - POWER_MARGIN_W
        return np.clip(ramped, engine.power_min_w, engine.power_max_w)

    def _powers_w(self, at: Seconds) -> Floats:
        """Engine powers tried, 0 for the engine off first; shape (n, commands)."""
        engine = self._vehicle.engine
        greatest = self.greatest_w(at)
        shares = np.linspace(0.0, 1.0, POWERS)
        running = engine.power_min_w + np.outer(greatest - engine.power_min_w, shares)
        return np.concatenate([np.zeros((len(greatest), 1)), running], axis=1)

    def _excess(self, at: Seconds, on: Floats, p_eng_w: Floats, margins: float = 0.0) -> Excess:
        """Excess over the limits drawn in by so many margins of the safety layer."""
        starts = on * (1.0 - at.engine_on[:, None])
        cranked_w = starts * self._vehicle.engine.start_energy_j
        power, soc = self._of_battery(at, p_eng_w, np.zeros_like(cranked_w), margins)
        if cranked_w.any():
            power_too, soc_too = self._of_battery(at, p_eng_w, cranked_w, margins)
            power, soc = np.maximum(power, power_too), np.maximum(soc, soc_too)
        fastest = self._vehicle.engine.electric_max_mps + SPEED_ROUNDING_MPS
        power = np.where((on == 0.0) & (at.speed_mps[:, None] > fastest), np.inf, power)
        return Excess(power, soc, self._of_coolant(at, on, p_eng_w, starts, margins))

    def _of_battery(
        self, at: Seconds, p_eng_w: Floats, cranked_w: Floats, margins: float
    ) -> tuple[Floats, Floats]:
        """Excess of the battery's power, and of SOC after the second."""
        battery = self._vehicle.battery
        eq, soc, demand = self._equations, at.soc[:, None], at.demand_w[:, None]
        # the current that just fills the battery in a second, and what the brakes leave to it
        filling = np.maximum(battery.soc_max - soc, 0.0) * eq.charge_c
        accepted = np.minimum(-eq.terminal_w(soc, -filling), eq.charge_max_w)
        asked = demand + battery.aux_power_w + cranked_w - p_eng_w
        braked = np.minimum(-accepted, asked + np.maximum(-demand, 0.0))
        p_bat = np.where(asked >= -accepted, asked, braked)
        inside_w, inside = margins * POWER_MARGIN_W, margins * SOC_MARGIN
        after = soc - eq.internal_w(soc, p_bat) / eq.voltage_v(soc) / eq.charge_c
        most_w = eq.discharge_max_w
        return (
            _beyond(p_bat, -eq.charge_max_w + inside_w, most_w - inside_w),
            _beyond(after, battery.soc_min + inside, battery.soc_max - inside),
        )

    def _of_coolant(
        self, at: Seconds, on: Floats, p_eng_w: Floats, starts: Floats, margins: float
    ) -> Floats:
        """Excess of the coolant temperature after the second."""
        thermal, engine = self._vehicle.thermal, self._vehicle.engine
        eq, t_cl = self._equations, at.t_cl_degc[:, None]
        fuel = np.interp(p_eng_w, self._table_w, self._table_g_per_s) * eq.alpha(t_cl)
        fuel = on * fuel + starts * engine.start_fuel_g
        heat = (1.0 - thermal.exhaust_share) * (fuel * eq.lhv_j_per_g - p_eng_w * on)
        lost = eq.ua_w_per_k(at.speed_mps[:, None]) * (t_cl - thermal.t_amb_degc)
        lost = lost + eq.cabin_w(t_cl) + eq.radiator_w(t_cl)
        warmer = t_cl + (heat - lost) / thermal.heat_capacity_j_per_k
        inside_k = margins * T_CL_MARGIN_K
        return _beyond(warmer, thermal.t_cl_min_degc + inside_k, thermal.t_cl_max_degc - inside_k)


def _beyond(values: Floats, low: float, high: float) -> Floats:
    return np.maximum(np.maximum(low - values, values - high), 0.0)
