"""Adaptive ECMS: Pontryagin's minimum principle with costates adapted to what is measured."""

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.plant import Command, Plant

Factor = Annotated[float, Field(ge=0.0, le=20.0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class EcmsSettings(BaseModel):
    """Costates of the adaptive ECMS and how they follow the state.

    The defaults come from a scan on NYCC and the truncated NEDC: a tuning to the trips at hand,
    which `mh-qp` does without.

    Attributes
    ----------
    factor : s at the reference SOC, fuel energy that a unit of stored battery energy is worth
    factor_per_soc : how much s rises for a unit of SOC below the reference
    factor_per_soc_s : how much s rises each second for a unit of SOC below the reference
    factor_min, factor_max : range of s
    t_cl_band_k : coolant heat is worth something within this distance of its lower limit
    heat_factor : fuel energy that coolant heat is worth at the limit itself, per unit
    power_step_w : spacing of the engine powers compared
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    factor: Factor = 2.7
    factor_per_soc: NotNegative = 10.0
    factor_per_soc_s: NotNegative = 0.02
    factor_min: Factor = 1.5
    factor_max: Factor = 5.0
    t_cl_band_k: Positive = 3.0
    heat_factor: Factor = 1.5
    power_step_w: Annotated[float, Field(ge=10.0, le=10e3)] = 250.0


class Ecms:
    """Adaptive equivalent consumption minimisation; no preview.

    Each second the engine is off, or at that power, at which

        H = alpha(T) F(P_eng) + (s G(P_d + P_aux - P_eng) - mu Q(P_eng)) / LHV      [g/s]

    is least: F fuel of the hot engine, G internal battery power, Q heat into the coolant. The
    equivalence factor follows the SOC, s = s0 + k_p e + k_i sum(e), e = SOC_init - SOC, and the
    coolant's costate mu rises linearly from 0 at the edge of the band above the lower coolant
    limit to `heat_factor` at the limit. The safety layer has the last word.

    Source: the paper's introduction (PMP); the adaptation is the usual PI law on SOC.
    """

    name = "ecms"
    solver_name = ""

    def __init__(self, plant: Plant, settings: EcmsSettings, heat_power_w: float) -> None:
        self.settings = settings
        self._plant, self._vehicle = plant, plant.vehicle
        self._safety = SafetyLayer(plant, heat_power_w)
        engine = plant.vehicle.engine
        count = int(np.ceil((engine.power_max_w - engine.power_min_w) / settings.power_step_w)) + 1
        powers_w = np.linspace(engine.power_min_w, engine.power_max_w, count)
        # the first candidate is the engine off
        self._power_w = np.concatenate([[0.0], powers_w])
        self._fuel_g_per_s = np.concatenate([[0.0], plant.line.fuel(powers_w)])
        self._sum_soc_s = 0.0

    def equivalence_factor(self, soc: float) -> float:
        """Equivalence factor s for a measured SOC, with the sum of earlier deviations."""
        s = self.settings
        error = self._vehicle.trip.soc_init - soc
        factor = s.factor + s.factor_per_soc * error + s.factor_per_soc_s * self._sum_soc_s
        return min(max(factor, s.factor_min), s.factor_max)

    def heat_costate(self, t_cl_degc: float) -> float:
        """Costate mu for a measured coolant temperature."""
        room_k = t_cl_degc - self._vehicle.thermal.t_cl_min_degc
        nearness = 1.0 - room_k / self.settings.t_cl_band_k
        return self.settings.heat_factor * min(max(nearness, 0.0), 1.0)

    def decide(self, seen: Observation) -> Decision:
        """Minimise H over the engine off and a grid of powers, then the safety layer."""
        vehicle = self._vehicle
        battery, thermal = vehicle.battery, vehicle.thermal
        lhv_j_per_g = vehicle.engine.lhv_j_per_g
        fuel_w = alpha_at(vehicle.cold_engine, seen.t_cl_degc) * self._fuel_g_per_s * lhv_j_per_g
        heat_w = (1.0 - thermal.exhaust_share) * (fuel_w - self._power_w)
        accepted_w = self._plant.battery.charge_limit_w(seen.soc, self._plant.step_s)
        terminal_w = seen.demand_w + battery.aux_power_w - self._power_w
        internal_w = self._plant.battery.internal_power_w(
            seen.soc, np.maximum(terminal_w, -accepted_w)
        )
        cost_w = (
            fuel_w
            + self.equivalence_factor(seen.soc) * internal_w
            - self.heat_costate(seen.t_cl_degc) * heat_w
        )
        allowed = terminal_w <= battery.power_discharge_max_w
        allowed[1:] &= terminal_w[1:] >= -accepted_w
        best = int(np.where(allowed, cost_w, np.inf).argmin())
        self._sum_soc_s += vehicle.trip.soc_init - seen.soc
        wish = Command(best > 0, float(self._power_w[best]))
        return Decision(self._safety.admissible(wish, seen))
