"""The numbers of one generated controller: sizes, parameters and tables, as the runtime wants."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.codegen.forecast_values import fixed_block_s, forecast_scalars
from qpmpc.controllers import mh_qp, planner, safety
from qpmpc.controllers.mh_qp import PLAN_VALID_STEPS, MhQpSettings
from qpmpc.controllers.planner import DEPARTURE_LINEARISATIONS, WARM_UP_STEPS
from qpmpc.controllers.rule_based import RuleBasedSettings
from qpmpc.errors import InputError
from qpmpc.pwa.model import PwaModel
from qpmpc.qp import linearisation, stage_qp
from qpmpc.qp.coolant import radiator_w_per_k
from qpmpc.qp.stage_qp import T_CL_MAX_MARGIN_K
from qpmpc.solvers import base
from qpmpc.vehicle import demand
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import OptimalLine
from qpmpc.vehicle.parameters import Vehicle

EQUALITY_RHO_FACTOR = 1000.0  # OSQP's own, on rows whose bounds are closer than the next figure
EQUALITY_WIDTH = 1e-4  # solver units

# What the C code has in common with the Python controller, by module: names in C and their values.
CONSTANTS: dict[str, dict[str, float]] = {
    mh_qp.__name__: {"ON_THRESHOLD": mh_qp.ON_THRESHOLD, "LEAST_SIZE_W": mh_qp.LEAST_SIZE_W},
    planner.__name__: {"FAILURES_FORGIVEN": planner.FAILURES_FORGIVEN},
    linearisation.__name__: {
        "COLDEST_DEGC": linearisation.COLDEST_DEGC,
        "HOTTEST_DEGC": linearisation.HOTTEST_DEGC,
        "DEPARTURE_FUEL_G_PER_S": linearisation.DEPARTURE_FUEL_G_PER_S,
        "DEPARTURE_P_ENG_W": linearisation.DEPARTURE_P_ENG_W,
    },
    safety.__name__: {
        "SOC_MARGIN": safety.SOC_MARGIN,
        "T_CL_MARGIN_K": safety.T_CL_MARGIN_K,
        "T_CL_COOLING_K": safety.T_CL_COOLING_K,
        "T_CL_NEAR_K": safety.T_CL_NEAR_K,
        "BISECTIONS": safety.BISECTIONS,
    },
    stage_qp.__name__: {
        "SHORTEST_SCALE_S": stage_qp.SHORTEST_SCALE_S,
        "REACH_MARGIN_SOC": stage_qp.REACH_MARGIN_SOC,
        "ACCURATE_STAGE_S": stage_qp.ACCURATE_STAGE_S,
        "SIGMA_FORCED": stage_qp.SIGMA_FORCED,
        "LEAST_COST": stage_qp.LEAST_COST,
    },
    base.__name__: {"LARGEST_PLAUSIBLE": base.LARGEST_PLAUSIBLE},
    demand.__name__: {"GRAVITY_MPS2": demand.GRAVITY_MPS2},
}


@dataclass(frozen=True)
class Sizes:
    """What fixes the dimensions of a generated controller.

    Attributes
    ----------
    short_stages, blocks, classes : layout of the horizon
    fuel_pieces, battery_pieces, alpha_pieces : pieces of the PWA curves
    fuel_points, soc_points : points of the tables
    """

    short_stages: int
    blocks: int
    classes: int
    fuel_pieces: int
    battery_pieces: int
    alpha_pieces: int
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

    @property
    def rows(self) -> int:
        """Rows of a stage."""
        return 9 + self.fuel_pieces + self.battery_pieces


@dataclass(frozen=True)
class Values:
    """Everything that a generated controller is made of.

    Attributes
    ----------
    vehicle : its name
    sizes : dimensions
    scalars, arrays : members of the runtime's `mpc_model`
    iterations, departure_iterations : K of a step and of each linearisation before the trip
    departure_linearisations, plan_valid_steps, warm_up_steps : as the Python controller has them
    duration_exponent : of the column scaling
    min_on_s : shortest engine run of the rules
    block_s : length of a block; 0 where the trip's length sets it
    """

    vehicle: str
    sizes: Sizes
    scalars: dict[str, float]
    arrays: dict[str, NDArray[np.float64]]
    iterations: int
    departure_iterations: int
    duration_exponent: float
    min_on_s: int
    block_s: int
    departure_linearisations: int = DEPARTURE_LINEARISATIONS
    plan_valid_steps: int = PLAN_VALID_STEPS
    warm_up_steps: int = WARM_UP_STEPS


def values_of(
    vehicle: Vehicle, settings: MhQpSettings, rules: RuleBasedSettings, blocks: int | None = None
) -> Values:
    """Collect the numbers of a controller.

    Parameters
    ----------
    vehicle : parameters
    settings : of the controller; its `prepared` concerns the caller of the C code
    rules : thresholds of the last rung of the ladder
    blocks : of the long horizon; needed where the settings cut the trip by length of a block

    Raises
    ------
    InputError
        If there is no long horizon, its number of blocks is open, or the terminal band is so
        narrow that the solver would take it for an equality.
    """
    model = PwaModel.of(vehicle, settings.pwa)
    line, maps = OptimalLine(vehicle.engine), BatteryMaps(vehicle.battery)
    blocks = settings.horizon.blocks if blocks is None else blocks
    if blocks < 1:
        raise InputError(
            "generated code needs a fixed number of blocks: set mh_qp.horizon.blocks to 1 or more"
        )
    scalars = {
        **_plant(vehicle, line, maps),
        **_problem(vehicle, model, settings),
        **_rules(vehicle, rules),
        **forecast_scalars(vehicle, settings.horizon),
    }
    if not settings.qp.soc_penalty_g:
        band = (scalars["terminal_soc_high"] - scalars["terminal_soc_low"]) / scalars["unit_soc"]
        if band < EQUALITY_WIDTH:
            raise InputError(
                "mh_qp.qp.terminal_low and terminal_high leave no band for the final SOC "
                f"(width {band * scalars['unit_soc']:.2g})"
            )
    grid = vehicle.battery.soc_grid
    arrays = {
        "fuel_slope": model.fuel.slope,
        "fuel_intercept": model.fuel.intercept,
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
    }
    return Values(
        vehicle=vehicle.name,
        sizes=Sizes(
            settings.horizon.short_stages,
            blocks,
            settings.horizon.classes,
            model.fuel.pieces,
            model.battery.pieces,
            model.alpha.pieces,
            len(line.power_w),
            len(grid),
        ),
        scalars=scalars,
        arrays=arrays,
        iterations=settings.osqp.iterations,
        departure_iterations=settings.osqp.cold_iterations,
        duration_exponent=settings.scaling.duration_exponent,
        min_on_s=rules.min_on_s,
        block_s=fixed_block_s(settings.horizon),
    )


def _array(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)


def _plant(vehicle: Vehicle, line: OptimalLine, maps: BatteryMaps) -> dict[str, float]:
    engine, cold, battery, trip = vehicle.engine, vehicle.cold_engine, vehicle.battery, vehicle.trip
    thermal = vehicle.thermal.model_dump()
    return {
        "engine_max_w": engine.power_max_w,
        "engine_min_w": engine.power_min_w,
        "lhv_j_per_g": engine.lhv_j_per_g,
        "fuel_step_w": float(line.power_w[1] - line.power_w[0]),
        "cold_k": cold.k,
        "cold_hot_degc": cold.hot_degc,
        "cold_span_k": cold.span_k,
        "cold_exponent": cold.exponent,
        **{name: float(value) for name, value in thermal.items()},
        "thermostat_w_per_k": radiator_w_per_k(vehicle.thermal),
        "charge_c": maps.charge_c,
        "battery_discharge_max_w": battery.power_discharge_max_w,
        "battery_charge_max_w": battery.power_charge_max_w,
        "soc_min": battery.soc_min,
        "soc_max": battery.soc_max,
        "aux_power_w": battery.aux_power_w,
        "soc_init": trip.soc_init,
        "t_cl_init_degc": trip.t_cl_init_degc,
        "plan_voltage_v": maps.open_circuit.at(trip.soc_init),
        "plan_resistance_discharge_ohm": maps.discharge.at(trip.soc_init),
        "plan_resistance_charge_ohm": maps.charge.at(trip.soc_init),
    }


def _problem(vehicle: Vehicle, model: PwaModel, settings: MhQpSettings) -> dict[str, float]:
    qp, units, osqp = settings.qp, settings.scaling, settings.osqp
    battery, thermal, soc_init = vehicle.battery, vehicle.thermal, vehicle.trip.soc_init
    return {
        "battery_energy_j": model.battery_energy_j,
        "soc_reserve": qp.soc_reserve * max(soc_init - battery.soc_min, 0.0),
        "terminal_soc_low": max(qp.terminal_low * soc_init, battery.soc_min),
        "terminal_soc_high": min(qp.terminal_high * soc_init, battery.soc_max),
        "soc_penalty_g": qp.soc_penalty_g,
        "t_min_degc": thermal.t_cl_min_degc + qp.t_cl_margin_k,
        "t_max_degc": thermal.t_cl_max_degc - T_CL_MAX_MARGIN_K,
        "slack_g_per_k": qp.slack_g_per_k,
        "regularisation": qp.regularisation,
        "unit_soc": units.energy_j / model.battery_energy_j,
        "unit_t_k": units.t_cl_k,
        "unit_power_w": units.power_w,
        "unit_fuel_g_per_s": units.fuel_g_per_s,
        "rho": osqp.rho,
        "inverse_rho": 1.0 / osqp.rho,
        "rho_equality": osqp.rho * EQUALITY_RHO_FACTOR,
        "sigma": osqp.sigma,
        "relaxation": osqp.relaxation,
    }


def _rules(vehicle: Vehicle, rules: RuleBasedSettings) -> dict[str, float]:
    return {
        "rule_k_soc_w": rules.k_soc_w,
        "rule_soc_ref": vehicle.trip.soc_init + rules.soc_ref_offset,
        "rule_on_w": rules.on_w,
        "rule_off_w": rules.off_w,
        "rule_power_min_w": rules.power_min_w,
        "rule_heat_power_w": rules.heat_power_w,
        "rule_heat_on_degc": rules.heat_on_degc,
        "rule_heat_off_degc": rules.heat_off_degc,
        "rule_soc_forced": rules.soc_forced,
    }
