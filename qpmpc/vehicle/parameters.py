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
Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Celsius = Annotated[float, Field(ge=-100.0, le=150.0)]
# Most entries of an array; a measured map has tens.
POINTS_MAX = 1000
# Not strict: TOML's arrays are lists. Their entries are.
_ARRAY = Field(min_length=2, max_length=POINTS_MAX, strict=False)
Speeds = Annotated[tuple[Annotated[float, Field(ge=10.0, le=20e3)], ...], _ARRAY]
Friction = Annotated[tuple[Annotated[float, Field(ge=1e-4, le=10.0)], ...], _ARRAY]
Torques = Annotated[tuple[Annotated[float, Field(ge=1.0, le=10e3)], ...], _ARRAY]
Powers = Annotated[tuple[Annotated[float, Field(ge=0.0, le=500e3)], ...], _ARRAY]
FuelRates = Annotated[tuple[Annotated[float, Field(ge=0.0, le=100.0)], ...], _ARRAY]
Charges = Annotated[tuple[Annotated[float, Field(ge=-1.0, le=2.0)], ...], _ARRAY]
Voltages = Annotated[tuple[Annotated[float, Field(ge=1.0, le=2e3)], ...], _ARRAY]
Resistances = Annotated[tuple[Annotated[float, Field(ge=1e-5, le=100.0)], ...], _ARRAY]

STEP_S = 1.0  # of plant and controllers: nothing may empty, heat or cool down within one
CRANKING_SHARE = 0.5  # of the battery's greatest power: a start leaves some to drive with
COLDEST_DEGC = -50.0  # at which the cold engine's fuel is checked
COLD_FACTOR_MAX = 10.0
EFFICIENCY_MAX = 0.6  # of an engine on its optimal line: the best reach 0.5
# The two descriptions of an engine's fuel, of which it has one.
MAP = (
    "displacement_l",
    "indicated_efficiency",
    "friction_speed_rpm",
    "friction_kj_per_rev_l",
    "torque_speed_rpm",
    "torque_max_nm",
)
LINE = ("line_power_w", "line_fuel_g_per_s")
LINE_TOO = ("line_speed_rpm",)
SPEED_MAX_MPS = 70.0  # at which forces and losses are checked


class Section(BaseModel):
    """A group of parameters: no unknown keys, only finite numbers, no change after loading.

    Strict, because otherwise pydantic takes true for 1 and "2" for 2.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _require_increasing(name: str, values: tuple[float, ...], least: float) -> None:
    if any(b - a < least for a, b in pairwise(values)):
        raise ValueError(f"{name} must increase from entry to entry, by {least:g} or more")


def _require_same_length(grid: tuple[float, ...], **tables: tuple[float, ...]) -> None:
    for name, table in tables.items():
        if len(table) != len(grid):
            raise ValueError(f"{name} must have {len(grid)} entries, one per grid point")


class Chassis(Section):
    """Road load F = A + B v + C v^2 + m k dv/dt + m g grade, and driveline efficiencies.

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
        return self


class Engine(Section):
    """Fuel map or optimal line, fuel, starts.

    Either a map, P_fuel = K(N) V_L N/60 + P_eng / indicated efficiency, with its torque limit
    (`MAP`), or the optimal line itself: fuel rate of the hot engine over its power, from 0 on
    (`LINE`), with the speed that it asks for where that is known.

    A start takes `start_fuel_g`, and from the battery the energy `start_energy_j` that cranks the
    engine. Started, it is to run for `min_on_s`, stopped, to rest for `min_off_s`. While on its
    power rises by no more than `ramp_w_per_s`, at the start from 0; it falls at once.
    """

    displacement_l: Annotated[float, Field(ge=0.05, le=20.0)] | None = None
    power_max_w: Annotated[float, Field(ge=500.0, le=500e3)]
    power_min_w: Annotated[float, Field(ge=0.0, le=500e3)]
    lhv_j_per_kg: Annotated[float, Field(ge=1e7, le=1.5e8)]  # methanol 2e7, hydrogen 1.2e8
    density_kg_per_l: Annotated[float, Field(ge=1e-5, le=2.0)]  # hydrogen gas 8e-5
    # 0.8: far above any engine
    indicated_efficiency: Annotated[float, Field(ge=0.15, le=0.8)] | None = None
    friction_speed_rpm: Speeds | None = None
    friction_kj_per_rev_l: Friction | None = None
    torque_speed_rpm: Speeds | None = None
    torque_max_nm: Torques | None = None
    line_power_w: Powers | None = None
    line_fuel_g_per_s: FuelRates | None = None
    line_speed_rpm: Speeds | None = None
    start_fuel_g: Annotated[float, Field(ge=0.0, le=10.0)]  # burnt within a second
    start_energy_j: Annotated[float, Field(ge=0.0, le=250e3)] = 0.0  # drawn within a second
    min_on_s: Annotated[int, Field(ge=0, le=600)] = 0
    min_off_s: Annotated[int, Field(ge=0, le=600)] = 0
    ramp_w_per_s: Annotated[float, Field(gt=0.0, le=1e6)] = 1e6  # free: no engine has so much power

    @property
    def lhv_j_per_g(self) -> float:
        """Lower heating value in the unit of fuel rates."""
        return self.lhv_j_per_kg * 1e-3

    @model_validator(mode="after")
    def _check(self) -> Self:
        given = [name for name in (*MAP, *LINE, *LINE_TOO) if getattr(self, name) is not None]
        is_line = bool(given) and given[0] not in MAP
        if is_line:
            missing = [name for name in LINE if name not in given]
        else:
            missing = [name for name in MAP if name not in given]
        other = [name for name in given if (name in MAP) == is_line]
        if missing or other:
            raise ValueError(
                f"needs either its map, {', '.join(MAP)}, or its optimal line, {' and '.join(LINE)}"
                f" ({f'missing: {missing[0]}' if missing else f'beside the map: {other[0]}'})"
            )
        if is_line:
            self._check_line()
        else:
            self._check_map()
        if self.power_min_w >= self.power_max_w:
            raise ValueError("power_min_w must be below power_max_w")
        if self.ramp_w_per_s * STEP_S < self.power_min_w:
            raise ValueError(
                f"ramp_w_per_s must reach power_min_w, {self.power_min_w:g} W, in the {STEP_S:g} s "
                "of a start"
            )
        return self

    def _check_map(self) -> None:
        friction_rpm, torque_rpm = self.friction_speed_rpm or (), self.torque_speed_rpm or ()
        _require_increasing("friction_speed_rpm", friction_rpm, least=1.0)
        _require_increasing("torque_speed_rpm", torque_rpm, least=1.0)
        _require_same_length(friction_rpm, friction_kj_per_rev_l=self.friction_kj_per_rev_l or ())
        _require_same_length(torque_rpm, torque_max_nm=self.torque_max_nm or ())
        if min(friction_rpm[-1], torque_rpm[-1]) <= max(friction_rpm[0], torque_rpm[0]):
            raise ValueError("friction_speed_rpm and torque_speed_rpm must have speeds in common")

    def _check_line(self) -> None:
        power_w, fuel_g_per_s = self.line_power_w or (), self.line_fuel_g_per_s or ()
        _require_increasing("line_power_w", power_w, least=1.0)
        _require_same_length(power_w, line_fuel_g_per_s=fuel_g_per_s)
        if self.line_speed_rpm is not None:
            _require_same_length(power_w, line_speed_rpm=self.line_speed_rpm)
        if power_w[0] != 0.0:
            raise ValueError("line_power_w must begin at 0, an engine that idles")
        if power_w[-1] < self.power_max_w * (1.0 - 1e-3):
            raise ValueError("line_power_w must reach power_max_w")
        for (p, fuel), (_, more) in pairwise(zip(power_w, fuel_g_per_s, strict=True)):
            if more <= fuel:
                raise ValueError(
                    f"line_fuel_g_per_s must increase with power: it does not above {p:g} W"
                )
        most = max(
            p / (fuel * self.lhv_j_per_g)
            for p, fuel in zip(power_w[1:], fuel_g_per_s[1:], strict=True)
        )
        if most > EFFICIENCY_MAX:
            raise ValueError(
                f"line_fuel_g_per_s makes the engine {most:.0%} efficient, at most "
                f"{EFFICIENCY_MAX:.0%} are allowed: g/s are needed"
            )


class ColdEngine(Section):
    """Cold multiplier alpha(T) = 1 + k ((T_hot - T)/span)^exponent below T_hot, else 1."""

    k: Annotated[float, Field(ge=0.0, le=10.0)]
    hot_degc: Celsius
    span_k: Annotated[float, Field(ge=1.0, le=500.0)]
    exponent: Annotated[float, Field(ge=1.0, le=4.0)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        below_k = max(self.hot_degc - COLDEST_DEGC, 0.0)
        alpha = 1.0 + self.k * (below_k / self.span_k) ** self.exponent
        if alpha > COLD_FACTOR_MAX:
            raise ValueError(
                f"k, span_k and exponent multiply fuel by {alpha:.3g} at {COLDEST_DEGC:g} degC, at "
                f"most {COLD_FACTOR_MAX:g} are allowed"
            )
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
    """Open-circuit voltage and resistances over SOC, power and SOC limits, auxiliary load."""

    capacity_ah: Annotated[float, Field(ge=0.01, le=10e3)]
    soc_grid: Charges
    open_circuit_v: Voltages
    resistance_discharge_ohm: Resistances
    resistance_charge_ohm: Resistances
    power_discharge_max_w: Annotated[float, Field(ge=100.0, le=500e3)]
    power_charge_max_w: Annotated[float, Field(ge=100.0, le=500e3)]
    soc_min: Share
    soc_max: Share
    aux_power_w: Annotated[float, Field(ge=0.0, le=50e3)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_increasing("soc_grid", self.soc_grid, least=1e-6)
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
        room_j = 3600.0 * self.capacity_ah * float(np.min(voltage)) * (self.soc_max - self.soc_min)
        largest = max(self.power_discharge_max_w, self.power_charge_max_w)
        if room_j < largest * STEP_S:
            raise ValueError(
                f"capacity_ah holds {room_j:.3g} J within soc_min..soc_max, less than a step of "
                f"{STEP_S:g} s at power_discharge_max_w or power_charge_max_w, {largest:.3g} W"
            )
        return self


class Trip(Section):
    """Initial state of a run, and the price of a difference in final SOC."""

    soc_init: Share
    t_cl_init_degc: Annotated[float, Field(ge=-50.0, le=150.0)]  # no colder than the air
    eta_eq: Annotated[float, Field(ge=0.01, lt=1.0)]


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
        if not self.battery.soc_min <= self.trip.soc_init <= self.battery.soc_max:
            raise ValueError("trip.soc_init must lie between battery.soc_min and battery.soc_max")
        most_j = CRANKING_SHARE * self.battery.power_discharge_max_w * STEP_S
        if self.engine.start_energy_j > most_j:
            raise ValueError(
                f"engine.start_energy_j must be at most {most_j:g} J, {CRANKING_SHARE:.0%} of what "
                f"battery.power_discharge_max_w gives in the {STEP_S:g} s of a start"
            )
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
