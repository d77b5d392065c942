"""The numbers of one generated controller: sizes, parameters and tables, as in the runtime."""

from dataclasses import dataclass, field
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.calibration import Calibration, calibration_of
from qpmpc.codegen.forecast_values import fixed_block_s
from qpmpc.codegen.shared_values import Sizes, shared_values
from qpmpc.controllers import heating_run, last_run, monitor, qp_planner, realise, safety
from qpmpc.controllers.qp_planner import DEPARTURE_LINEARISATIONS, WARM_UP_STEPS
from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS
from qpmpc.controllers.settings import MhQpSettings, RuleBasedSettings
from qpmpc.errors import InputError
from qpmpc.preview import checked, swing
from qpmpc.pwa import learned_fuel, priced
from qpmpc.pwa.model import PwaModel
from qpmpc.pwa.model import learned_fuel as learner_of
from qpmpc.qp import coolant_floor, linearisation, polish, relaxation, rows, stage_qp
from qpmpc.qp.quantities import pieces_of
from qpmpc.qp.rows import Rows, Table, table_of
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.solvers import base
from qpmpc.solvers.settings import AdmmSettings
from qpmpc.vehicle import demand
from qpmpc.vehicle.parameters import Vehicle

EQUALITY_RHO_FACTOR = 1000.0  # OSQP's own, on rows whose bounds are closer than the next figure
EQUALITY_WIDTH = 1e-4  # solver units


def of_modules(*modules: tuple[ModuleType, str]) -> dict[str, dict[str, float]]:
    """Return constants common to the C code and the Python controller, by module: names in C."""
    return {
        module.__name__: {name: getattr(module, name) for name in names.split()}
        for module, names in modules
    }


CONSTANTS_OF_ALL = of_modules(
    (linearisation, "COLDEST_DEGC HOTTEST_DEGC DEPARTURE_FUEL_G_PER_S DEPARTURE_P_ENG_W"),
    (safety, "POWER_MARGIN_W SOC_MARGIN T_CL_MARGIN_K"),
    (monitor, "LONG_AGO_S LONGEST_GAP_S"),
    (checked, "LONGEST_STAGE_S NEWS SAME_MEANS_W"),
    (swing, "NO_LIMIT_J LEAST_KEPT_J FALL_SHARE DRAIN_SHARE FILLED_SHARE"),
    (coolant_floor, "USABLE ARRIVAL_K"),
    (heating_run, "IDLING_W BEYOND_K LEAST_GROWTH"),
    (
        last_run,
        "LEAST_GAIN_W WANTED_LEAST FUEL_LEAST MUST_LEAST_S"
        " START_PAYS START_LEAST START_MOST START_SOON SAME_G",
    ),
    (qp_planner, "FAILURES_FORGIVEN"),
    (base, "LARGEST_PLAUSIBLE"),
    (demand, "GRAVITY_MPS2 ROAD_LOAD_DEGC"),
)
CONSTANTS = CONSTANTS_OF_ALL | of_modules(
    (relaxation, "LEAST_SIZE_W"),
    (stage_qp, "LEAST_COST"),
    (priced, "LEAST_RATIO LEAST_PRICE"),
    (realise, "STAY_S STAY_SHARE"),
    (rows, "SHORTEST_SCALE_S SIGMA_FORCED COOL_SHARE SOC_KEPT MOOT_G_PER_S"),
)

OF_LEARNING = {  # beside those, where the fuel map is learned
    learned_fuel.__name__: {
        name: getattr(learned_fuel, name)
        for name in (
            *("KEPT", "PRIOR_IDLE", "PRIOR_SLOPE", "PRIOR_LATE"),
            *("RATIO_LEAST", "RATIO_MOST", "IDLE_MOST", "SLOPE_MOST", "SUM_MOST"),
        )
    }
}


@dataclass(frozen=True)
class Values:
    """All numbers of a generated controller.

    Attributes
    ----------
    vehicle : its name
    table : of its QP
    sizes : dimensions
    scalars, counts, arrays : members of the runtime's `mpc_model`
    calibration : those of its `mpc_calibration`
    iterations, departure_iterations : K of a step and of each linearisation before the trip
    departure_linearisations, plan_valid_steps, warm_up_steps : as in the Python controller
    duration_exponent : of the column scaling
    block_s : length of a block; 0 if blocks share out what is ahead
    learning : whether the fuel map is learned
    constants : common to the C code and Python, by module
    costate : sizes of the costate method; None with the QP
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
    calibration: Calibration
    departure_linearisations: int = DEPARTURE_LINEARISATIONS
    plan_valid_steps: int = PLAN_VALID_STEPS
    warm_up_steps: int = WARM_UP_STEPS
    constants: dict[str, dict[str, float]] = field(default_factory=lambda: CONSTANTS)
    costate: dict[str, int] | None = None

    @property
    def has_start(self) -> bool:
        """Whether a start of the engine costs anything."""
        return self.table.has_start

    @property
    def row_count(self) -> int:
        """Rows of a stage that have a dual."""
        return self.rows.count if self.costate is None else 2

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
    curves = polish.Polish(vehicle, model, settings.learning).curves
    shared = shared_values(vehicle, model, settings.horizon, rules, blocks, section, curves)
    scalars = {
        **qp_parameters(vehicle, model, settings.qp, settings.scaling),
        **shared.scalars,
        **_solver(settings.admm),
        "entry_share": settings.horizon.entry_share,
    }
    if not settings.qp.soc_penalty_g:
        band = (scalars["terminal_soc_high"] - scalars["terminal_soc_low"]) / scalars["unit_soc"]
        if band < EQUALITY_WIDTH:
            raise InputError(
                f"{section}.qp.terminal_low and terminal_high leave no band for the final SOC "
                f"(width {band * scalars['unit_soc']:.2g})"
            )
    arrays = {
        **pieces_of(model),
        **shared.arrays,
    }
    if settings.learning:
        del arrays["line_slope"], arrays["line_intercept"]  # those learned instead
        learner = learner_of(vehicle, settings.pwa)
        scalars["learned_most_g"] = learner.most_g
        arrays["learned_power_w"] = learner.power_w
        arrays["learned_map_g_per_s"] = learner.map_g_per_s
    table = table_of(vehicle.engine)
    band_soc = 0.0 if settings.qp.soc_penalty_g else EQUALITY_WIDTH * scalars["unit_soc"]
    calibration = calibration_of(
        vehicle, scalars, table.has_start, settings.learning, band_soc=band_soc
    )
    return Values(
        vehicle=vehicle.name,
        table=table,
        sizes=shared.sizes,
        scalars=calibration.without(scalars),
        calibration=calibration,
        arrays=arrays,
        iterations=settings.admm.iterations,
        departure_iterations=settings.admm.cold_iterations,
        duration_exponent=settings.scaling.duration_exponent,
        counts={"polish": int(settings.polish), **shared.counts},
        block_s=fixed_block_s(settings.horizon),
        learning=settings.learning,
        constants=CONSTANTS | (OF_LEARNING if settings.learning else {}),
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


def _solver(admm: AdmmSettings) -> dict[str, float]:
    return {
        "rho": admm.rho,
        "inverse_rho": 1.0 / admm.rho,
        "rho_equality": admm.rho * EQUALITY_RHO_FACTOR,
        "proximal": admm.proximal_weight,
        "relaxation": admm.relaxation,
    }
