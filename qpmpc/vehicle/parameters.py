"""Vehicle parameters: validated, immutable, units in every name.

A vehicle is a TOML file with the sections below, or one with a base and the values that differ
(`qpmpc.vehicle.load`). ``Vehicle.with_settings`` applies dotted overrides such as
``thermal.t_amb_degc=-15``.
"""

import re
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from qpmpc.settings import apply_settings, validated
from qpmpc.vehicle.engine_parameters import ColdEngine, Engine
from qpmpc.vehicle.section import (
    ARRAY,
    SPEED_MAX_MPS,
    STEP_S,
    Celsius,
    Section,
    require_increasing,
    require_same_length,
)


def _check_name(name: str) -> str:
    """Check a name, which becomes part of file names and of comments in C."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise ValueError(
            "must begin with a letter or digit and have at most 64 letters, digits, '.', '_', '-'"
        )
    return name


Name = Annotated[str, AfterValidator(_check_name)]
Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Charges = Annotated[tuple[Annotated[float, Field(ge=-1.0, le=2.0)], ...], ARRAY]
Voltages = Annotated[tuple[Annotated[float, Field(ge=1.0, le=2e3)], ...], ARRAY]
Resistances = Annotated[tuple[Annotated[float, Field(ge=1e-5, le=100.0)], ...], ARRAY]

CRANKING_SHARE = 0.5  # of the battery's greatest power: a start leaves some to drive with
DERATING_DEGC = 10.0  # ambient temperature below which the battery's power limits fall
POWER_SHARE_LEAST = 0.1  # of the battery's rated power that the cold has to leave
POWER_SHARE_ROUNDING = 1e-9


class Chassis(Section):
    """Road load F = A + B v + C v^2 + m k dv/dt + m g grade, and driveline efficiencies.

    `road_load_share_per_k` is by how much A, B and C grow per K below 24 degC. Regeneration fades
    out between `regen_full_mps` and `regen_from_mps`; it does not where both are 0.

    From the smallest city car to a truck of 10 t. B may be negative, as some fits to coast-downs
    have it, but the road may push the car at no speed.
    """

    mass_kg: Annotated[float, Field(ge=500.0, le=10e3)]
    rotating_mass_factor: Annotated[float, Field(ge=1.0, le=1.5)]
    road_load_a_n: Annotated[float, Field(ge=0.0, le=5e3)]  # 5 % of the weight of 10 t
    road_load_b_n_per_mps: Annotated[float, Field(ge=-100.0, le=500.0)]  # 500: 10 t, 70 m/s, 36 %
    road_load_c_n_per_mps2: Annotated[float, Field(ge=0.0, le=20.0)]  # c_d A of 33 m^2
    eta_drive: Annotated[float, Field(ge=0.1, le=1.0)]
    eta_regen: Annotated[float, Field(ge=0.0, le=1.0)]
    road_load_share_per_k: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0  # air alone: 0.4 %
    regen_from_mps: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    regen_full_mps: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        a, b, c = self.road_load_a_n, self.road_load_b_n_per_mps, self.road_load_c_n_per_mps2
        lowest_at = min(-b / (2.0 * c), SPEED_MAX_MPS) if c > 0.0 else SPEED_MAX_MPS
        least = a + lowest_at * (b + c * lowest_at)
        if b < 0.0 and least < 0.0:
            raise ValueError(
                f"road_load_b_n_per_mps must not make the road load negative: it is {least:.3g} N "
                f"at {lowest_at:.3g} m/s"
            )
        if self.regen_from_mps > 0.0 and self.regen_full_mps <= self.regen_from_mps:
            raise ValueError("regen_full_mps must be above regen_from_mps")
        return self


class Thermal(Section):
    """Coolant as one heat store: capacity, losses, thermostat, cabin heat and limits.

    A radiator of 0 W/K is none. The capacity is at least that of a litre of water, at most so
    large that the temperature stays; the losses may cool it no faster than within a step.
    """

    heat_capacity_j_per_k: Annotated[float, Field(ge=4e3, le=1e9)]
    exhaust_share: Share
    ua0_w_per_k: Annotated[float, Field(ge=0.0, le=10e3)]
    ua1_w_per_k_per_mps: Annotated[float, Field(ge=0.0, le=1e3)]
    thermostat_open_degc: Celsius
    thermostat_span_k: Annotated[float, Field(ge=0.1, le=100.0)]
    radiator_w_per_k: Annotated[float, Field(ge=0.0, le=20e3)]  # a truck's gives 300 kW at 80 K
    t_amb_degc: Annotated[float, Field(ge=-50.0, le=50.0)]
    cabin_heat_w: Annotated[float, Field(ge=0.0, le=50e3)]  # a coach's
    cabin_heat_from_degc: Celsius
    cabin_heat_full_degc: Celsius
    t_cl_min_degc: Celsius
    t_cl_max_degc: Celsius

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.t_cl_min_degc >= self.t_cl_max_degc:
            raise ValueError("t_cl_min_degc must be below t_cl_max_degc")
        if self.cabin_heat_full_degc - self.cabin_heat_from_degc < 0.1:
            raise ValueError("cabin_heat_from_degc must be below cabin_heat_full_degc, by 0.1 K")
        if self.t_amb_degc >= self.thermostat_open_degc:
            raise ValueError("t_amb_degc must be below thermostat_open_degc")
        opening = (self.thermostat_open_degc + self.thermostat_span_k - self.t_amb_degc) / (
            self.thermostat_span_k
        )
        slope = self.radiator_w_per_k * (1.0 + opening)
        slope += self.ua0_w_per_k + self.ua1_w_per_k_per_mps * SPEED_MAX_MPS
        slope += self.cabin_heat_w / (self.cabin_heat_full_degc - self.cabin_heat_from_degc)
        if slope * STEP_S > self.heat_capacity_j_per_k:
            raise ValueError(
                f"heat_capacity_j_per_k must be at least {slope * STEP_S:.3g}: otherwise air, "
                "radiator and cabin, whose heat rises by that many W per K where the thermostat "
                f"opens, let the coolant swing within a step of {STEP_S:g} s"
            )
        return self


class Battery(Section):
    """Open-circuit voltage and resistances over SOC, power and SOC limits, auxiliary load.

    The power limits are rated ones. `derating_share_per_k` of them is lost per K of the ambient
    below `DERATING_DEGC`; those in force are `Vehicle.battery_discharge_max_w` and
    `battery_charge_max_w`.
    """

    capacity_ah: Annotated[float, Field(ge=0.01, le=10e3)]
    soc_grid: Charges
    open_circuit_v: Voltages
    resistance_discharge_ohm: Resistances
    resistance_charge_ohm: Resistances
    power_discharge_max_w: Annotated[float, Field(ge=100.0, le=500e3)]
    power_charge_max_w: Annotated[float, Field(ge=100.0, le=500e3)]
    derating_share_per_k: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0
    soc_min: Share
    soc_max: Share
    aux_power_w: Annotated[float, Field(ge=0.0, le=50e3)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        require_increasing("soc_grid", self.soc_grid, least=1e-6)
        require_same_length(
            self.soc_grid,
            open_circuit_v=self.open_circuit_v,
            resistance_discharge_ohm=self.resistance_discharge_ohm,
            resistance_charge_ohm=self.resistance_charge_ohm,
        )
        if self.soc_grid[0] > 0.0 or self.soc_grid[-1] < 1.0:
            raise ValueError("soc_grid must reach from 0 to 1")
        if self.soc_min >= self.soc_max:
            raise ValueError("soc_min must be below soc_max")
        grid = [self.soc_min, self.soc_max]
        grid += [soc for soc in self.soc_grid if self.soc_min < soc < self.soc_max]
        voltage = np.interp(grid, self.soc_grid, self.open_circuit_v)
        resistance = np.interp(grid, self.soc_grid, self.resistance_discharge_ohm)
        weakest = float(np.min(voltage**2 / (4.0 * resistance)))
        if self.power_discharge_max_w >= weakest:
            raise ValueError(
                f"power_discharge_max_w must be below U_oc^2/(4 R) = {weakest:.0f} W, the most "
                "the battery can give within soc_min..soc_max"
            )
        room_j = 3600.0 * self.capacity_ah * float(np.min(voltage)) * (self.soc_max - self.soc_min)
        largest = max(self.power_discharge_max_w, self.power_charge_max_w)
        if room_j < largest * STEP_S:
            raise ValueError(
                f"capacity_ah holds {room_j:.3g} J within soc_min..soc_max, less than a step of "
                f"{STEP_S:g} s at power_discharge_max_w or power_charge_max_w, {largest:.3g} W"
            )
        return self


class Trip(Section):
    """State at departure, SOC to arrive with, and the price of a difference in final SOC.

    `soc_end` is `soc_init` where it is not given. With `soc_end_at_least` an SOC above it at
    arrival is allowed, and worth nothing.
    """

    soc_init: Share
    soc_end: Share | None = None
    soc_end_at_least: bool = False
    t_cl_init_degc: Annotated[float, Field(ge=-50.0, le=150.0)]  # no colder than the air
    eta_eq: Annotated[float, Field(ge=0.01, lt=1.0)]

    @property
    def soc_target(self) -> float:
        """SOC to arrive with."""
        return self.soc_init if self.soc_end is None else self.soc_end

    @property
    def soc_mean(self) -> float:
        """Half way from departure to arrival: where a plan takes the battery's curves."""
        return 0.5 * (self.soc_init + self.soc_target)

    @property
    def soc_lower_end(self) -> float:
        """The lower one of the two."""
        return min(self.soc_init, self.soc_target)


class Vehicle(Section):
    """All parameters of the plant."""

    name: Name
    description: Annotated[str, Field(max_length=1000)] = ""
    chassis: Chassis
    engine: Engine
    cold_engine: ColdEngine
    thermal: Thermal
    battery: Battery
    trip: Trip

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, soc in (("soc_init", self.trip.soc_init), ("soc_end", self.trip.soc_target)):
            if not self.battery.soc_min <= soc <= self.battery.soc_max:
                raise ValueError(
                    f"trip.{name} must lie between battery.soc_min and battery.soc_max, "
                    f"{self.battery.soc_min:g}..{self.battery.soc_max:g} (given: {soc:g})"
                )
        lost = 1.0 - self.battery_power_share
        if lost > 1.0 - POWER_SHARE_LEAST + POWER_SHARE_ROUNDING:
            raise ValueError(
                f"battery.derating_share_per_k = {self.battery.derating_share_per_k:g} takes "
                f"{lost:.4g} of battery.power_discharge_max_w and power_charge_max_w at "
                f"thermal.t_amb_degc = {self.thermal.t_amb_degc:g}: at least "
                f"{POWER_SHARE_LEAST:g} of them must be left"
            )
        most_j = CRANKING_SHARE * self.battery_discharge_max_w * STEP_S
        if self.engine.start_energy_j > most_j:
            derated = f" at {self.thermal.t_amb_degc:g} degC" if lost else ""
            raise ValueError(
                f"engine.start_energy_j must be at most {most_j:g} J, {CRANKING_SHARE:.0%} of what "
                f"battery.power_discharge_max_w gives{derated} in the {STEP_S:g} s of a start"
            )
        return self

    @property
    def battery_power_share(self) -> float:
        """Share of the battery's rated power limits in force: 1 - share max(10 degC - T_amb, 0).

        The battery is taken to be at ambient temperature for the whole trip.
        """
        below_k = max(DERATING_DEGC - self.thermal.t_amb_degc, 0.0)
        return 1.0 - self.battery.derating_share_per_k * below_k

    @property
    def battery_discharge_max_w(self) -> float:
        """Most power that the battery gives on this trip, W."""
        return self.battery_power_share * self.battery.power_discharge_max_w

    @property
    def battery_charge_max_w(self) -> float:
        """Most power that the battery takes on this trip, W; positive."""
        return self.battery_power_share * self.battery.power_charge_max_w

    def with_settings(self, settings: dict[str, object]) -> "Vehicle":
        """Return a copy with dotted keys replaced, e.g. ``{"thermal.t_amb_degc": -15}``.

        Raises
        ------
        InputError
            If a key does not exist or a value is not allowed.
        """
        if not settings:
            return self
        data = apply_settings(self.model_dump(), settings, owner=f"vehicle {self.name}")
        return validated(Vehicle, data, f"vehicle {self.name}")
