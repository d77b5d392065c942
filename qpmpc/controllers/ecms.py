"""Adaptive ECMS: Pontryagin's minimum principle with costates adapted to measurements."""

import numpy as np

from qpmpc.controllers.base import Controller, Progress
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.must_run import must_run
from qpmpc.vehicle.plant import Command


class Ecms(Controller):
    """Adaptive equivalent consumption minimisation; no preview.

    Each second the engine is off, or runs at the power, whichever minimises

        H = alpha(T) F(P_eng) + (s G(P_d + P_aux - P_eng) - mu Q(P_eng)) / LHV      [g/s]

    with F fuel of the hot engine, G internal battery power, Q heat into the coolant. The
    equivalence factor follows the SOC, s = s0 + k_p e + k_i sum(e), e = SOC_target - SOC, and the
    coolant's costate mu rises linearly from 0 at the edge of the band above the lower coolant
    limit to `heat_factor` at the limit. Off is no choice where the engine must run. The safety
    layer has the last word.

    Source: the paper's introduction (PMP); the adaptation is the usual PI law on SOC.
    """

    name = "ecms"

    def __init__(self, trip: Trip, settings: ControllerSettings | None = None) -> None:
        super().__init__(trip, settings)
        self._plant, self._vehicle = trip.plant, trip.vehicle
        self._ecms = self.settings.ecms
        engine, step_w = trip.vehicle.engine, self._ecms.power_step_w
        count = int(np.ceil((engine.power_max_w - engine.power_min_w) / step_w)) + 1
        powers_w = np.linspace(engine.power_min_w, engine.power_max_w, count)
        # the first candidate is the engine off
        self._power_w = np.concatenate([[0.0], powers_w])
        self._fuel_g_per_s = np.concatenate([[0.0], trip.plant.line.fuel(powers_w)])
        self._sum_soc_s = 0.0

    def depart(self, progress: Progress | None = None) -> None:
        """Forget the deviations of any earlier trip."""
        self._sum_soc_s = 0.0

    def equivalence_factor(self, soc: float) -> float:
        """Equivalence factor s for a measured SOC, with the sum of earlier deviations."""
        s = self._ecms
        error = self._vehicle.trip.soc_target - soc
        factor = s.factor + s.factor_per_soc * error + s.factor_per_soc_s * self._sum_soc_s
        return min(max(factor, s.factor_min), s.factor_max)

    def heat_costate(self, t_cl_degc: float) -> float:
        """Costate mu for a measured coolant temperature."""
        room_k = t_cl_degc - self._vehicle.thermal.t_cl_min_degc
        nearness = 1.0 - room_k / self._ecms.t_cl_band_k
        return self._ecms.heat_factor * min(max(nearness, 0.0), 1.0)

    def step(self, seen: Observation) -> Command:
        """Minimise H over the engine off and a grid of powers."""
        vehicle = self._vehicle
        battery, thermal = vehicle.battery, vehicle.thermal
        lhv_j_per_g = vehicle.engine.lhv_j_per_g
        fuel_w = alpha_at(vehicle.cold_engine, seen.t_cl_degc) * self._fuel_g_per_s * lhv_j_per_g
        heat_w = (1.0 - thermal.exhaust_share) * (fuel_w - self._power_w)
        accepted_w = self._plant.charge_limit_w(seen.soc)
        terminal_w = seen.demand_w + battery.aux_power_w - self._power_w
        internal_w = self._plant.battery.internal_power_w(
            seen.soc, np.maximum(terminal_w, -accepted_w)
        )
        cost_w = (
            fuel_w
            + self.equivalence_factor(seen.soc) * internal_w
            - self.heat_costate(seen.t_cl_degc) * heat_w
        )
        must = must_run(vehicle, float(terminal_w[0]), seen.speed_mps)
        allowed = terminal_w <= vehicle.battery_discharge_max_w
        allowed[0] = not must
        allowed[1:] &= terminal_w[1:] >= -accepted_w
        # where nothing is allowed, off or the least power: the safety layer does the rest
        best = max(int(np.where(allowed, cost_w, np.inf).argmin()), int(must))
        self._sum_soc_s += vehicle.trip.soc_target - seen.soc
        return Command(best > 0, float(self._power_w[best]))
