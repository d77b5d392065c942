"""The numbers of a generated costate controller, beside those that every method needs."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.calibration import Bounds, calibration_of
from qpmpc.codegen.forecast_values import fixed_block_s
from qpmpc.codegen.shared_values import BEYOND_ALL_W, shared_values
from qpmpc.codegen.values import CONSTANTS_OF_ALL, Values, of_modules
from qpmpc.controllers import mh_costate
from qpmpc.controllers.mh_costate import MhCostateSettings, most_charge_g
from qpmpc.controllers.settings import RuleBasedSettings
from qpmpc.costate import certificate, dual, funnel, program, solve
from qpmpc.costate.path import Shortest
from qpmpc.errors import InputError
from qpmpc.pwa import priced
from qpmpc.pwa.curves import Curves
from qpmpc.pwa.model import PwaModel
from qpmpc.qp import rows
from qpmpc.qp.rows import table_of
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

MOST_STATES = 32  # of the shortest path, a bit each

CONSTANTS = CONSTANTS_OF_ALL | of_modules(
    (rows, "SHORTEST_SCALE_S LEAST_FORCED COOL_SHARE SOC_KEPT"),
    (priced, "LEAST_RATIO LEAST_PRICE"),
    (funnel, "ENDLESS_RESPONSE LEAST_RESPONSE UNLIMITED"),
    (
        solve,
        "CHARGE_QUARTER_STEPS BACKGROUND LEAST_DECAY AT_SLACK MOST_SHARE GROWS SHRINKS STREAK",
    ),
    (certificate, "ABOVE_MULTIPLIERS"),
    (mh_costate, "EXPANSION_STEP"),
)


def costate_values_of(
    vehicle: Vehicle,
    settings: MhCostateSettings,
    rules: RuleBasedSettings,
    blocks: int | None = None,
) -> Values:
    """Collect the numbers of a controller that plans by costates.

    Parameters
    ----------
    vehicle, rules, blocks : as of `values_of`
    settings : of the controller

    Raises
    ------
    InputError
        If there is no long horizon or its number of blocks is open, or shortest run or rest and
        short horizon are both longer than generated code can hold.
    """
    model, engine = PwaModel.of(vehicle), vehicle.engine
    curves = Curves.of(vehicle, model.line)
    shared = shared_values(vehicle, model, settings.horizon, rules, blocks, "mh_costate", curves)
    envelope, shortest = curves.envelope(), Shortest.of(engine)
    stride = 1 << max((len(envelope.slope) - 1).bit_length() - 1, 0)
    most_states = settings.horizon.short_stages + 1
    run, rest = min(shortest.on_s, most_states), min(shortest.off_s, most_states)
    if max(run, rest) > MOST_STATES:
        raise InputError(
            f"generated C of mh-costate: engine.min_on_s={engine.min_on_s} and min_off_s="
            f"{engine.min_off_s} may be {MOST_STATES} at most with "
            f"mh_costate.horizon.short_stages={settings.horizon.short_stages}"
        )
    table = table_of(engine)
    moderate_w, moderate_g_per_s = program.moderate(curves)
    limits = QpSettings(**settings.limits.model_dump())
    scalars = {
        **qp_parameters(vehicle, model, limits, ScalingSettings()),
        **shared.scalars,
        "moderate_w": moderate_w,
        "moderate_g_per_s": moderate_g_per_s,
        "usual_charge_g": program.USUAL_CHARGE * program.unit_g(model),
        "most_charge_g": most_charge_g(model),
    }
    scalars["cranking_soc"] = scalars["cranking_j"] / scalars["battery_energy_j"]
    arrays = {
        **shared.arrays,
        "shared": _for_bisection(envelope, stride),
    }
    calibration = calibration_of(vehicle, scalars, table.has_start, search=_search(table.has_start))
    return Values(
        vehicle=vehicle.name,
        table=table,
        sizes=shared.sizes,
        scalars=calibration.without(scalars),
        calibration=calibration,
        arrays=arrays,
        iterations=settings.rounds_of(engine),
        departure_iterations=mh_costate.DEPARTURE_ROUNDS,
        duration_exponent=0.0,
        counts={"polish": 1, **shared.counts},
        block_s=fixed_block_s(settings.horizon),
        learning=False,
        departure_linearisations=mh_costate.DEPARTURE_LINEARISATIONS,
        warm_up_steps=1,
        constants=CONSTANTS
        | of_modules(
            (program, "LEAST_SWITCH_G LEAST_WORTH"),
            (dual, "EDGE" + (" START_QUARTER_STEPS" if table.has_start else "")),
        ),
        costate={
            "SHARED_PIECES": len(envelope.slope),
            "SHARED_STRIDE": stride,
            "RUN_STATES": run,
            "REST_STATES": rest,
        },
    )


def _for_bisection(envelope: Curves, stride: int) -> Floats:
    """Slope, end, begin, intercept of as many pieces as halvings from this stride tell apart.

    Nothing lies beyond the end of the last piece, or of those after it, which are none.
    """
    e = envelope
    end = np.append(e.end_w[:-1], BEYOND_ALL_W)
    rows = np.column_stack([e.slope, end, e.begin_w, e.intercept])
    table: Floats = np.vstack([rows, *[rows[-1:]] * (2 * stride - len(rows))]).ravel()
    return table


def _search(has_start: bool) -> dict[str, tuple[float, Bounds]]:
    """Numbers of the search that are tuned, with their bounds: a tenth of them to ten times."""
    second, longer = program.switches_g_per_s(has_start)
    return {
        "search_least_rise_g": (solve.LEAST_RISE_G, (1e-9, 1e-2)),
        "search_first_share": (solve.FIRST_SHARE, (0.1, solve.MOST_SHARE)),
        "search_switch_g_per_s": (second, (0.1 * second, 10.0 * second)),
        "search_long_switch_g_per_s": (longer, (0.1 * longer, 10.0 * longer)),
    }
