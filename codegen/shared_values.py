"""The numbers of a generated controller that do not depend on how it plans."""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.codegen.forecast_values import forecast_scalars
from qpmpc.controllers.rule_based import last_rung
from qpmpc.controllers.settings import RuleBasedSettings
from qpmpc.errors import InputError
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.pwa.curves import Curves
from qpmpc.pwa.model import PwaModel
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import OptimalLine, optimal_line
from qpmpc.vehicle.parameters import Vehicle

BEYOND_ALL_W = 1e30


@dataclass(frozen=True)
class Sizes:
    """The dimensions of a generated controller.

    Attributes
    ----------
    short_stages, blocks, classes : layout of the horizon
    fuel_pieces, battery_pieces, alpha_pieces : pieces of the PWA curves
    line_pieces : chords of the engine's line
    fuel_points, soc_points : points of the tables
    """

    short_stages: int
    blocks: int
    classes: int
    fuel_pieces: int
    battery_pieces: int
    alpha_pieces: int
    line_pieces: int
    fuel_points: int
    soc_points: int

    @property
    def long_stages(self) -> int:
        """Stages beyond the short horizon."""
        return self.blocks * self.classes

    @property
    def stages(self) -> int:
        """All stages."""
        return self.short_stages + self.long_stages


class Shared(NamedTuple):
    """Numbers of the parts that every method has: preview, maps, safety, rules."""

    sizes: Sizes
    scalars: dict[str, float]
    arrays: dict[str, NDArray[np.float64]]
    counts: dict[str, int]


def shared_values(
    vehicle: Vehicle,
    model: PwaModel,
    horizon: HorizonSettings,
    rules: RuleBasedSettings,
    blocks: int | None,
    section: str,
    curves: Curves,
) -> Shared:
    """Collect the numbers that do not depend on the method; `curves` are those of a second.

    Raises
    ------
    InputError
        If there is no long horizon or its number of blocks is open.
    """
    line, maps = optimal_line(vehicle.engine), BatteryMaps(vehicle.battery)
    blocks = horizon.blocks if blocks is None else blocks
    if blocks < 1:
        raise InputError(
            f"generated code needs a fixed number of blocks: set {section}.horizon.blocks to 1 or "
            "more"
        )
    grid = vehicle.battery.soc_grid
    return Shared(
        Sizes(
            horizon.short_stages,
            blocks,
            horizon.classes,
            model.fuel.pieces,
            model.battery.pieces,
            model.alpha.pieces,
            len(curves.slope),
            len(line.power_w),
            len(grid),
        ),
        {
            **_plant(vehicle, line, maps),
            **_battery_of(curves),
            **_rules(vehicle, last_rung(rules, vehicle)),
            **forecast_scalars(vehicle, horizon),
        },
        {
            "battery_slope": model.battery.slope,
            "battery_intercept": model.battery.intercept,
            "alpha_slope": model.alpha.slope,
            "alpha_intercept": model.alpha.intercept,
            "alpha_break": model.alpha.breakpoints[:-1],
            "soc_grid": _array(grid),
            "open_circuit_v": _array(vehicle.battery.open_circuit_v),
            "resistance_charge_ohm": _array(vehicle.battery.resistance_charge_ohm),
            "resistance_discharge_ohm": _array(vehicle.battery.resistance_discharge_ohm),
            "fuel_g_per_s": line.fuel_g_per_s,
            "line_begin_w": curves.begin_w,
            "line_end_w": np.append(curves.end_w[:-1], BEYOND_ALL_W),
            "line_slope": curves.slope,
            "line_intercept": curves.intercept,
        },
        {
            "min_on_s": vehicle.engine.min_on_s,
            "min_off_s": vehicle.engine.min_off_s,
            "rule_min_on_s": max(rules.min_on_s, vehicle.engine.min_on_s),
        },
    )


def _array(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)


def _plant(vehicle: Vehicle, line: OptimalLine, maps: BatteryMaps) -> dict[str, float]:
    """Maps of the plant that the QP does not contain; the plan's battery is at the mean SOC."""
    cold, soc_mean = vehicle.cold_engine, vehicle.trip.soc_mean
    return {
        "fuel_step_w": float(line.power_w[1] - line.power_w[0]),  # grid of fuel_g_per_s, from 0
        **{f"cold_{name}": float(value) for name, value in cold.model_dump().items()},
        **{f"can_{name}": value for name, value in asdict(Capability.of(vehicle, line)).items()},
        "charge_c": maps.charge_c,
        "start_energy_j": vehicle.engine.start_energy_j,
        "ramp_w_per_s": vehicle.engine.ramp_w_per_s,
        "aux_power_w": vehicle.battery.aux_power_w,
        "t_cl_init_degc": vehicle.trip.t_cl_init_degc,
        "plan_voltage_v": maps.open_circuit.at(soc_mean),
        "plan_resistance_discharge_ohm": maps.discharge.at(soc_mean),
        "plan_resistance_charge_ohm": maps.charge.at(soc_mean),
    }


def _battery_of(curves: Curves) -> dict[str, float]:
    """Return U^2 / (4 R) of the plan's battery, and mean and half difference of 4 R / U^2."""
    discharge_ohm, charge_ohm, square_v2 = curves.discharge_ohm, curves.charge_ohm, curves.square_v2
    return {
        "quarter_discharge_w": square_v2 / (4.0 * discharge_ohm),
        "quarter_charge_w": square_v2 / (4.0 * charge_ohm),
        "per_quarter_mean": 2.0 * (discharge_ohm + charge_ohm) / square_v2,
        "per_quarter_half": 2.0 * (discharge_ohm - charge_ohm) / square_v2,
    }


def _rules(vehicle: Vehicle, rules: RuleBasedSettings) -> dict[str, float]:
    return {
        "rule_k_soc_w": rules.k_soc_w,
        "rule_soc_ref": vehicle.trip.soc_target + rules.soc_ref_offset,
        "rule_on_w": rules.on_w,
        "rule_off_w": rules.off_w,
        "rule_power_min_w": rules.power_min_w,
        "rule_heat_power_w": rules.heat_power_w,
        "rule_heat_on_degc": rules.heat_on_degc,
        "rule_heat_off_degc": rules.heat_off_degc,
        "rule_soc_forced": rules.forced_below(vehicle.battery),
    }
