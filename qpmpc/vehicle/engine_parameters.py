"""Parameters of the engine: its fuel, as a map or as an optimal line, its limits, its starts."""

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from qpmpc.vehicle.section import (
    ARRAY,
    SPEED_MAX_MPS,
    STEP_S,
    Celsius,
    Section,
    require_increasing,
    require_same_length,
)

Speeds = Annotated[tuple[Annotated[float, Field(ge=10.0, le=20e3)], ...], ARRAY]
Friction = Annotated[tuple[Annotated[float, Field(ge=1e-4, le=10.0)], ...], ARRAY]
Torques = Annotated[tuple[Annotated[float, Field(ge=1.0, le=10e3)], ...], ARRAY]
Powers = Annotated[tuple[Annotated[float, Field(ge=0.0, le=500e3)], ...], ARRAY]
FuelRates = Annotated[tuple[Annotated[float, Field(ge=0.0, le=100.0)], ...], ARRAY]

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


class Engine(Section):
    """Fuel map or optimal line, fuel, starts.

    Either a map, P_fuel = K(N) V_L N/60 + P_eng / indicated efficiency, with its torque limit
    (`MAP`), or the optimal line itself: fuel rate of the hot engine over its power, from 0 on
    (`LINE`), with the speed that it asks for where that is known.

    A start takes `start_fuel_g`, and from the battery the energy `start_energy_j` that cranks the
    engine. Started, it is to run for `min_on_s`, stopped, to rest for `min_off_s`. While on its
    power rises by no more than `ramp_w_per_s`, at the start from 0; it falls at once.

    In a second whose mean speed is above `electric_max_mps` it has to be on, at any power that its
    limits allow, 0 included: a power split cannot hold it still any more, its generator would
    turn too fast. The default is no limit.
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
    electric_max_mps: Annotated[float, Field(ge=0.0, le=SPEED_MAX_MPS)] = SPEED_MAX_MPS

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
        require_increasing("friction_speed_rpm", friction_rpm, least=1.0)
        require_increasing("torque_speed_rpm", torque_rpm, least=1.0)
        require_same_length(friction_rpm, friction_kj_per_rev_l=self.friction_kj_per_rev_l or ())
        require_same_length(torque_rpm, torque_max_nm=self.torque_max_nm or ())
        if min(friction_rpm[-1], torque_rpm[-1]) <= max(friction_rpm[0], torque_rpm[0]):
            raise ValueError("friction_speed_rpm and torque_speed_rpm must have speeds in common")

    def _check_line(self) -> None:
        power_w, fuel_g_per_s = self.line_power_w or (), self.line_fuel_g_per_s or ()
        require_increasing("line_power_w", power_w, least=1.0)
        require_same_length(power_w, line_fuel_g_per_s=fuel_g_per_s)
        if self.line_speed_rpm is not None:
            require_same_length(power_w, line_speed_rpm=self.line_speed_rpm)
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
