"""Vehicle parameters: validated, immutable, units in every name.

A vehicle is a TOML file with the sections below, or one with a base and the values that differ
(`qpmpc.vehicle.load`). ``Vehicle.with_settings`` applies dotted overrides such as
``thermal.t_amb_degc=-15``.
"""

import re
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from qpmpc.settings import apply_settings, validated


def _check_name(name: str) -> str:
    """Check a name, which becomes part of file names and of comments in C."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise ValueError(
            "must begin with a letter or digit and have at most 64 letters, digits, '.', '_', '-'"
        )
    return name


Name = Annotated[str, AfterValidator(_check_name)]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Celsius = Annotated[float, Field(ge=-100.0, le=150.0)]
# Not strict: TOML's arrays are lists. Their entries are.
Grid = Annotated[tuple[float, ...], Field(min_length=2, strict=False)]
Table = Annotated[tuple[Positive, ...], Field(min_length=2, strict=False)]


class Section(BaseModel):
    """A group of parameters: no unknown keys, only finite numbers, no change after loading.

    Strict, because otherwise pydantic takes true for 1 and "2" for 2.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _require_increasing(name: str, values: tuple[float, ...]) -> None:
    if any(b <= a for a, b in pairwise(values)):
        raise ValueError(f"{name} must increase from entry to entry")


def _require_same_length(grid: tuple[float, ...], **tables: tuple[float, ...]) -> None:
    for name, table in tables.items():
        if len(table) != len(grid):
            raise ValueError(f"{name} must have {len(grid)} entries, one per grid point")


class Chassis(Section):
    """Road load F = A + B v + C v^2 + m k dv/dt + m g grade, and driveline efficiencies."""

    mass_kg: Annotated[float, Field(ge=500.0, le=10000.0)]
    rotating_mass_factor: Annotated[float, Field(ge=1.0, le=1.5)]
    road_load_a_n: NonNegative
    road_load_b_n_per_mps: float
    road_load_c_n_per_mps2: NonNegative
    eta_drive: Annotated[float, Field(gt=0.0, le=1.0)]
    eta_regen: Annotated[float, Field(ge=0.0, le=1.0)]


class Engine(Section):
    """Fuel map P_fuel = K(N) V_L N/60 + P_eng / indicated efficiency, torque limit, fuel."""

    displacement_l: Positive
    power_max_w: Positive
    power_min_w: NonNegative
    lhv_j_per_kg: Annotated[float, Field(ge=1e7, le=1.5e8)]
    density_kg_per_l: Positive
    indicated_efficiency: Share
    friction_speed_rpm: Table
    friction_kj_per_rev_l: Table
    torque_speed_rpm: Table
    torque_max_nm: Table
    start_fuel_g: NonNegative

    @property
    def lhv_j_per_g(self) -> float:
        """Lower heating value in the unit of fuel rates."""
        return self.lhv_j_per_kg * 1e-3

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_increasing("friction_speed_rpm", self.friction_speed_rpm)
        _require_increasing("torque_speed_rpm", self.torque_speed_rpm)
        _require_same_length(
            self.friction_speed_rpm, friction_kj_per_rev_l=self.friction_kj_per_rev_l
        )
        _require_same_length(self.torque_speed_rpm, torque_max_nm=self.torque_max_nm)
        if self.power_min_w >= self.power_max_w:
            raise ValueError("power_min_w must be below power_max_w")
        return self


class ColdEngine(Section):
    """Cold multiplier alpha(T) = 1 + k ((T_hot - T)/span)^exponent below T_hot, else 1."""

    k: NonNegative
    hot_degc: Celsius
    span_k: Positive
    exponent: Annotated[float, Field(ge=1.0, le=4.0)]


class Thermal(Section):
    """Coolant as one heat store: capacity, losses, thermostat, cabin heat and limits."""

    heat_capacity_j_per_k: Positive
    exhaust_share: Share
    ua0_w_per_k: NonNegative
    ua1_w_per_k_per_mps: NonNegative
    thermostat_open_degc: Celsius
    thermostat_span_k: Positive
    radiator_w_per_k: NonNegative
    t_amb_degc: Annotated[float, Field(ge=-50.0, le=50.0)]
    cabin_heat_w: NonNegative
    cabin_heat_from_degc: Celsius
    cabin_heat_full_degc: Celsius
    t_cl_min_degc: Celsius
    t_cl_max_degc: Celsius

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.t_cl_min_degc >= self.t_cl_max_degc:
            raise ValueError("t_cl_min_degc must be below t_cl_max_degc")
        if self.cabin_heat_from_degc >= self.cabin_heat_full_degc:
            raise ValueError("cabin_heat_from_degc must be below cabin_heat_full_degc")
        return self


class Battery(Section):
    """Open-circuit voltage and resistances over SOC, power and SOC limits, auxiliary load."""

    capacity_ah: Positive
    soc_grid: Grid
    open_circuit_v: Table
    resistance_discharge_ohm: Table
    resistance_charge_ohm: Table
    power_discharge_max_w: Positive
    power_charge_max_w: Positive
    soc_min: Share
    soc_max: Share
    aux_power_w: NonNegative

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_increasing("soc_grid", self.soc_grid)
        _require_same_length(
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
        return self


class Trip(Section):
    """Initial state of a run, and the price of a difference in final SOC."""

    soc_init: Share
    t_cl_init_degc: Celsius
    eta_eq: Share


class Vehicle(Section):
    """All parameters of the plant."""

    name: Name
    description: str = ""
    chassis: Chassis
    engine: Engine
    cold_engine: ColdEngine
    thermal: Thermal
    battery: Battery
    trip: Trip

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.battery.soc_min <= self.trip.soc_init <= self.battery.soc_max:
            raise ValueError("trip.soc_init must lie between battery.soc_min and battery.soc_max")
        if not self.thermal.t_amb_degc < self.thermal.thermostat_open_degc:
            raise ValueError("thermal.t_amb_degc must be below thermal.thermostat_open_degc")
        return self

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
