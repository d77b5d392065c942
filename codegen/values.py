"""The numbers of one generated controller: sizes, parameters and tables, as in the runtime."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.codegen.forecast_values import fixed_block_s, forecast_scalars
from qpmpc.controllers import monitor, qp_planner, ramp, realise, safety
from qpmpc.controllers.qp_planner import DEPARTURE_LINEARISATIONS, WARM_UP_STEPS
from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS
from qpmpc.controllers.rule_based import last_rung
from qpmpc.controllers.settings import MhQpSettings, RuleBasedSettings
from qpmpc.errors import InputError
from qpmpc.preview import checked, swing
from qpmpc.pwa import learned_fuel
from qpmpc.pwa.model import PwaModel
from qpmpc.pwa.model import learned_fuel as learner_of
from qpmpc.qp import coolant_floor, linearisation, polish, rows, stage_qp
from qpmpc.qp.quantities import pieces_of
from qpmpc.qp.rows import Rows, Table, table_of
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.solvers import base
from qpmpc.solvers.settings import AdmmSettings
from qpmpc.vehicle import demand
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import OptimalLine, optimal_line
from qpmpc.vehicle.parameters import Vehicle

EQUALITY_RHO_FACTOR = 1000.0  # OSQP's own, on rows whose bounds are closer than the next figure
EQUALITY_WIDTH = 1e-4  # solver units

# Constants common to the C code and the Python controller, by module: names in C.
CONSTANTS: dict[str, dict[str, float]] = {
    module.__name__: {name: getattr(module, name) for name in names.split()}
    for module, names in (
        (ramp, "SOC_KEPT"),
        (realise, "ON_THRESHOLD"),
        (qp_planner, "FAILURES_FORGIVEN LEAST_SIZE_W"),
        (linearisation, "COLDEST_DEGC HOTTEST_DEGC DEPARTURE_FUEL_G_PER_S DEPARTURE_P_ENG_W"),
        (safety, "POWER_MARGIN_W SOC_MARGIN T_CL_MARGIN_K"),
        (monitor, "LONG_AGO_S LONGEST_GAP_S"),
        (checked, "LONGEST_STAGE_S NEWS"),
        (swing, "NO_LIMIT_J LEAST_KEPT_J"),
        (stage_qp, "LEAST_COST"),
        (polish, "LEAST_RATIO"),
        (coolant_floor, "USABLE"),
        (rows, "SHORTEST_SCALE_S SIGMA_FORCED COOL_SHARE MOOT_G_PER_S"),
        (base, "LARGEST_PLAUSIBLE"),
        (demand, "GRAVITY_MPS2"),
    )
}

OF_LEARNING = {  # beside those, where the fuel map is learned
    learned_fuel.__name__: {
        name: getattr(learned_fuel, name)
        for name in (
            *("KEPT", "PRIOR_S", "LEVEL_MOST", "TILT_MOST"),
            *("RATIO_LEAST", "RATIO_MOST", "SUM_MOST"),
        )
    }
}


@dataclass(frozen=True)
class Sizes:
    """The dimensions of a generated controller.

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


@dataclass(frozen=True)
class Values:
    """All numbers of a generated controller.

    Attributes
    ----------
    vehicle : its name
    table : of its QP
    sizes : dimensions
    scalars, counts, arrays : members of the runtime's `mpc_model`
    iterations, departure_iterations : K of a step and of each linearisation before the trip
    departure_linearisations, plan_valid_steps, warm_up_steps : as in the Python controller
    duration_exponent : of the column scaling
    block_s : length of a block; 0 if the trip's length sets it
    learning : whether the fuel map is learned
    """

    vehicle: str
    table: Table
    sizes: Sizes
    scalars: dict[str, float]
    arrays: dict[str, NDArray[np.float64]]
    iterations: int
    departure_iterations: int
    duration_exponent: float
    counts: dict[str, int]
    block_s: int
    learning: bool
    departure_linearisations: int = DEPARTURE_LINEARISATIONS
    plan_valid_steps: int = PLAN_VALID_STEPS
    warm_up_steps: int = WARM_UP_STEPS

    @property
    def rows(self) -> Rows:
        """Rows of a stage."""
        return Rows(self.table, self.sizes.fuel_pieces, self.sizes.battery_pieces)

    @property
    def variables(self) -> int:
        """Number of variables of a stage."""
        return len(self.table.variables)


def values_of(
    vehicle: Vehicle,
    settings: MhQpSettings,
    rules: RuleBasedSettings,
    blocks: int | None = None,
    section: str = "mh_qp",
) -> Values:
    """Collect the numbers of a controller.

    Parameters
    ----------
    vehicle : parameters
    settings : of the controller; its `prepared` concerns the caller of the C code
    rules : thresholds of the last rung of the ladder
    blocks : of the long horizon; needed if the settings give the length of a block
    section : of the settings, for messages

    Raises
    ------
    InputError
        If there is no long horizon, its number of blocks is open, the terminal band is so narrow
        that the solver would treat it as an equality, or a setting is one of Python's solvers.
    """
    _refuse_unknown(settings, section)
    model = PwaModel.of(vehicle, settings.pwa, settings.learning)
    line, maps = optimal_line(vehicle.engine), BatteryMaps(vehicle.battery)
    blocks = settings.horizon.blocks if blocks is None else blocks
    if blocks < 1:
        raise InputError(
            f"generated code needs a fixed number of blocks: set {section}.horizon.blocks to 1 or "
            "more"
        )
    scalars = {
        **qp_parameters(vehicle, model, settings.qp, settings.scaling),
        **_plant(vehicle, line, maps),
        **_solver(settings.admm),
        **_rules(vehicle, last_rung(rules, vehicle)),
        **forecast_scalars(vehicle, settings.horizon),
    }
    if not settings.qp.soc_penalty_g:
        band = (scalars["terminal_soc_high"] - scalars["terminal_soc_low"]) / scalars["unit_soc"]
        if band < EQUALITY_WIDTH:
            raise InputError(
                f"{section}.qp.terminal_low and terminal_high leave no band for the final SOC "
                f"(width {band * scalars['unit_soc']:.2g})"
            )
    grid = vehicle.battery.soc_grid
    arrays = {
        **pieces_of(model),
        "fuel_begin_w": model.fuel.breakpoints[:-1],
        "alpha_slope": model.alpha.slope,
        "alpha_intercept": model.alpha.intercept,
        "alpha_break": model.alpha.breakpoints[:-1],
        "soc_grid": _array(grid),
        "open_circuit_v": _array(vehicle.battery.open_circuit_v),
        "resistance_charge_ohm": _array(vehicle.battery.resistance_charge_ohm),
        "resistance_discharge_ohm": _array(vehicle.battery.resistance_discharge_ohm),
        "fuel_g_per_s": line.fuel_g_per_s,
    }
    if settings.learning:
        learner = learner_of(vehicle, settings.pwa)
        scalars["learned_most_g"] = learner.most_g
        arrays["learned_power_w"] = learner.power_w
        arrays["learned_map_g_per_s"] = learner.map_g_per_s
    return Values(
        vehicle=vehicle.name,
        table=table_of(vehicle.engine),
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
        iterations=settings.admm.iterations,
        departure_iterations=settings.admm.cold_iterations,
        duration_exponent=settings.scaling.duration_exponent,
        counts={
            "polish": int(settings.polish),
            "min_on_s": vehicle.engine.min_on_s,
            "min_off_s": vehicle.engine.min_off_s,
            "rule_min_on_s": max(rules.min_on_s, vehicle.engine.min_on_s),
        },
        block_s=fixed_block_s(settings.horizon),
        learning=settings.learning,
    )


def _refuse_unknown(settings: MhQpSettings, section: str) -> None:
    """Refuse the settings that generated code does not have."""
    if settings.certificate:
        raise InputError(f"generated C has no certificate: no {section}.certificate=true")
    if settings.solver is not None:
        raise InputError(
            f"generated C has its own algorithm, not {section}.solver={settings.solver}"
        )
    if settings.admm.status_tolerance != AdmmSettings().status_tolerance:
        raise InputError(
            f"generated C has no {section}.admm.status_tolerance: it never stops early"
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


def _solver(admm: AdmmSettings) -> dict[str, float]:
    return {
        "rho": admm.rho,
        "inverse_rho": 1.0 / admm.rho,
        "rho_equality": admm.rho * EQUALITY_RHO_FACTOR,
        "proximal": admm.proximal_weight,
        "relaxation": admm.relaxation,
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
