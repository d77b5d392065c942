"""QPs for testing every backend: from closed loops, with degenerate and infeasible ones."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.qp.rows import Var
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.trip import Trip
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.problems.recorder import record

Floats = NDArray[np.float64]
Kind = Literal["ordinary", "degenerate", "infeasible"]

CITY, CITY_S = "nycc", 150
HIGHWAY, HIGHWAY_S = "hwfet", 120
COLD_MARGIN_K = 0.2  # above the coolant's lower limit, so that its slack is used
BARELY = 0.1  # solver units beyond the reachable: some 0.1 % of SOC, 0.1 K
INSIDE = 0.03  # room left, 0.03 % of SOC; with less PIQP or ProxQP may call it infeasible
THIRD = 2  # a stage under way
BLOCKS = 7  # of these trips of two minutes: with more, full charging leaves too little to decide


@dataclass(frozen=True)
class Problem:
    """One QP of the set.

    Attributes
    ----------
    kind : a degenerate one has a solution, but is hard to solve for the reason in its name; an
        infeasible one has no solution
    """

    name: str
    kind: Kind
    structure: QpStructure
    data: QpData


def problem_set(vehicle: Vehicle, settings: ControllerSettings | None = None) -> list[Problem]:
    """Make the set: QPs of two closed loops of `mh-qp`, and modifications of them.

    Parameters
    ----------
    vehicle : drives the beginning of a city cycle, and that of a highway with the coolant near
        its lower limit
    settings : of all controllers; the number of blocks is `BLOCKS`
    """
    cold_degc = vehicle.thermal.t_cl_min_degc + COLD_MARGIN_K
    cold = vehicle.with_settings({"trip.t_cl_init_degc": cold_degc})
    chosen = settings or ControllerSettings()
    chosen = chosen.with_settings({"mh_qp.horizon.blocks": BLOCKS})
    problems = []
    for name, trip in (
        ("city", Trip(_beginning(CITY, CITY_S), vehicle)),
        ("cold highway", Trip(_beginning(HIGHWAY, HIGHWAY_S), cold)),
    ):
        recording = record(trip, chosen)
        structure, departure = recording.structure, recording.solves[0].data
        steps = [qp.data for qp in recording.on_the_road]
        found: list[tuple[str, Kind, QpData]] = [
            ("departure", "ordinary", departure),
            ("under way", "ordinary", steps[10]),
            ("half way", "ordinary", steps[trip.steps // 2]),
            ("12 s left", "ordinary", steps[-12]),
            ("arrival, all but a second masked", "degenerate", steps[-1]),
            *_degenerate(structure, steps[trip.steps // 2]),
            *_infeasible(structure, steps[trip.steps // 2]),
        ]
        problems += [Problem(f"{name}: {what}", kind, structure, qp) for what, kind, qp in found]
    return problems


def _beginning(name: str, steps: int) -> Cycle:
    whole, inside = load_cycle(name), slice(steps + 1)
    return Cycle(name, whole.time_s[inside], whole.speed_mps[inside], whole.grade[inside])


def _degenerate(structure: QpStructure, data: QpData) -> Iterator[tuple[str, Kind, QpData]]:
    """QPs with solutions, but without curvature, with rows twice, or hardly any feasible point."""
    yield "without curvature", "degenerate", replace(data, hessian=np.zeros_like(data.hessian))
    yield "a fuel row twice", "degenerate", _row_twice(structure, data)
    last = structure.stages - 1
    row = last * structure.rows.count + structure.rows.first("box_soc")
    end = float(data.lower[row])
    yield "terminal band closed", "degenerate", _bounded(data, row, end, end)
    highest = _extreme(structure, data, last, Var.SOC)
    least = _in_row(structure, data, row, highest - INSIDE)
    yield "nothing but full charging is left", "degenerate", _bounded(data, row, least, np.inf)


def _infeasible(structure: QpStructure, data: QpData) -> Iterator[tuple[str, Kind, QpData]]:
    """QPs that demand a little more than is attainable, and one that demands much more."""
    rows, last = structure.rows, structure.stages - 1
    row = last * rows.count + rows.first("box_soc")
    more = _extreme(structure, data, last, Var.SOC) + BARELY
    needed = _in_row(structure, data, row, more)
    yield "terminal SOC out of reach", "infeasible", _bounded(data, row, needed, np.inf)
    row = THIRD * rows.count + rows.first("box_soc")
    tenfold = 10.0 * data.upper[row]
    yield "SOC ten times its limit", "infeasible", _bounded(data, row, tenfold, tenfold)

    held = _bounded(data, THIRD * rows.count + rows.first("box_slack"), 0.0, 0.0)
    row = THIRD * rows.count + rows.first("t_cl_max")
    colder = _extreme(structure, held, THIRD, Var.T_CL, highest=False) - BARELY
    allowed = _in_row(structure, held, row, colder)
    yield "coolant cannot be as cold", "infeasible", _bounded(held, row, -np.inf, allowed)

    row = THIRD * rows.count + rows.first("box_soc")
    lowest = _extreme(structure, data, THIRD, Var.SOC, highest=False) - BARELY
    limit = _in_row(structure, data, row, lowest)
    yield "battery cannot be as empty", "infeasible", _bounded(data, row, -np.inf, limit)


def _bounded(data: QpData, row: int, lower: float, upper: float) -> QpData:
    low, high = data.lower.copy(), data.upper.copy()
    low[row], high[row] = lower, upper
    return replace(data, lower=low, upper=high)


def _in_row(structure: QpStructure, data: QpData, row: int, value: float) -> float:
    """Value of a row whose first variable has that value and the others are zero."""
    return float(structure.matrix_of(data.a_data)[row].data.max() * value)


def _row_twice(structure: QpStructure, data: QpData) -> QpData:
    """Second fuel row of every stage equal to the first."""
    shape = structure.stages, len(structure.index)
    place = structure.data(np.arange(float(np.prod(shape))).reshape(shape)).astype(np.intp)
    values = np.zeros(shape)
    values.ravel()[place] = data.a_data
    first, rows = structure.rows.first("fuel"), structure.rows.count
    of_first, of_second = (structure.entry_row == row for row in (first, first + 1))
    values[:, of_second] = values[:, of_first]
    low, high = data.lower.reshape(-1, rows).copy(), data.upper.reshape(-1, rows).copy()
    low[:, first + 1], high[:, first + 1] = low[:, first], high[:, first]
    return replace(data, a_data=structure.data(values), lower=low.ravel(), upper=high.ravel())


def _extreme(
    structure: QpStructure, data: QpData, stage: int, var: Var, highest: bool = True
) -> float:
    """Highest or lowest value of a variable over all feasible points, solver units."""
    cost = np.zeros(structure.shape[1])
    cost[stage * structure.variables + var] = -1.0 if highest else 1.0
    a = structure.matrix_of(data.a_data)
    lower, upper = data.lower.copy(), data.upper.copy()
    if var is Var.SOC:
        row = stage * structure.rows.count + structure.rows.first("box_soc")
        lower[row], upper[row] = -np.inf, np.inf
    above, below = np.isfinite(upper), np.isfinite(lower)
    found = linprog(
        cost,
        A_ub=sp.vstack([a[above], -a[below]]),
        b_ub=np.concatenate([upper[above], -lower[below]]),
        bounds=[(None, None)] * structure.shape[1],
        method="highs",
    )
    if found.status != 0:
        raise RuntimeError(f"extreme of {var.name} in stage {stage}: {found.message}")
    return float(found.x[stage * structure.variables + var])
