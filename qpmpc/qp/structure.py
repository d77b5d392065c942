"""The QP's fixed structure: variables, rows and the sparsity pattern, stage by stage."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray


class Var(IntEnum):
    """Variables of a stage, in the order they stand in x."""

    SOC = 0  # at the end of the stage
    T_CL = 1  # degC, at the end of the stage
    P_ENG = 2  # E, mean engine power, W
    ON = 3  # sigma, share of the stage with the engine on
    FUEL = 4  # F, mean fuel rate of a hot engine, g/s
    INTERNAL = 5  # G, mean internal battery power, W
    T_SLACK = 6  # K beyond the coolant limits


VARS = len(Var)


@dataclass(frozen=True)
class Rows:
    """Rows of a stage, in the order they stand in A; counts depend on the PWA curves.

    Attributes
    ----------
    fuel_pieces, battery_pieces : pieces of the PWA curves
    """

    fuel_pieces: int
    battery_pieces: int

    @property
    def _boxes(self) -> int:
        return 2 + self.fuel_pieces + self.battery_pieces

    @property
    def soc(self) -> int:
        """SOC_k - SOC_{k-1} + h G / E_bat = 0."""
        return 0

    @property
    def t_cl(self) -> int:
        """Coolant balance, thermostat included."""
        return 1

    @property
    def fuel(self) -> slice:
        """F - a_i E - b_i sigma >= 0."""
        return slice(2, 2 + self.fuel_pieces)

    @property
    def battery(self) -> slice:
        """G + c_j E - (c_j P0 + d_j - l(P0)) sigma >= l(P0)."""
        first = 2 + self.fuel_pieces
        return slice(first, first + self.battery_pieces)

    @property
    def p_eng_max(self) -> int:
        """E - min(P_max, P0 + P_chg) sigma <= 0."""
        return self._boxes

    @property
    def p_eng_min(self) -> int:
        """E - P_min sigma >= what the battery cannot give."""
        return self._boxes + 1

    @property
    def box_soc(self) -> int:
        """SOC limits; in the last stage the terminal band."""
        return self._boxes + 2

    @property
    def box_on(self) -> int:
        """0 <= sigma <= 1; sigma = 1 where the battery alone cannot meet the demand."""
        return self._boxes + 3

    @property
    def t_cl_min(self) -> int:
        """T + slack >= T_min."""
        return self._boxes + 4

    @property
    def t_cl_max(self) -> int:
        """T - slack <= T_max."""
        return self._boxes + 5

    @property
    def box_slack(self) -> int:
        """Slack >= 0."""
        return self._boxes + 6

    @property
    def count(self) -> int:
        """Rows of a stage."""
        return self._boxes + 7


class QpStructure:
    """Sparsity pattern of the QP over n stages; values are filled in by `StageQp`.

    Entries of A are kept as an array (n, entries): column `e` holds one entry of every stage, in
    row `entry_row[e]` and variable `entry_var[e]` of that stage, or of the stage before where
    `entry_before[e]`. `data(values)` puts them in the order of the CSC matrix.

    Parameters
    ----------
    stages : n
    rows : row layout
    """

    def __init__(self, stages: int, rows: Rows) -> None:
        self.stages = stages
        self.rows = rows
        entries = _entries(rows)
        self.entry_row = np.array([row for row, _, _ in entries])
        self.entry_var = np.array([var for _, var, _ in entries])
        self.entry_before = np.array([before for _, _, before in entries])
        self.entry_start = np.flatnonzero(np.diff(self.entry_row, prepend=-1))
        self.index = {entry: e for e, entry in enumerate(entries)}
        k = np.arange(stages)[:, None]
        row = k * rows.count + self.entry_row
        column = (k - self.entry_before) * VARS + self.entry_var
        present = np.broadcast_to(column >= 0, row.shape) & ~((k == 0) & self.entry_before)
        position = np.arange(row.size).reshape(row.shape)
        order = sp.coo_matrix(
            (position[present] + 1.0, (row[present], column[present])), shape=self.shape
        ).tocsc()
        order.sort_indices()
        self._order = (order.data - 1.0).astype(np.intp)
        self._indices, self._indptr = order.indices, order.indptr

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of A."""
        return self.stages * self.rows.count, self.stages * VARS

    def data(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Order the entries (n, entries) as the data vector of the CSC matrix."""
        return np.asarray(values.ravel()[self._order])

    def matrix_of(self, data: NDArray[np.float64]) -> sp.csc_matrix:
        """Build A from its data vector; only set-up and tests need it."""
        return sp.csc_matrix((data, self._indices, self._indptr), shape=self.shape)


def _entries(rows: Rows) -> list[tuple[int, Var, bool]]:
    """Non-zeros of a stage as (row, variable, of the stage before), sorted by row."""
    here, before = False, True
    entries = [
        (rows.soc, Var.SOC, here),
        (rows.soc, Var.SOC, before),
        (rows.soc, Var.INTERNAL, here),
        (rows.t_cl, Var.T_CL, here),
        (rows.t_cl, Var.T_CL, before),
        (rows.t_cl, Var.P_ENG, here),
        (rows.t_cl, Var.FUEL, here),
        (rows.p_eng_max, Var.P_ENG, here),
        (rows.p_eng_max, Var.ON, here),
        (rows.p_eng_min, Var.P_ENG, here),
        (rows.p_eng_min, Var.ON, here),
        (rows.box_soc, Var.SOC, here),
        (rows.box_on, Var.ON, here),
        (rows.t_cl_min, Var.T_CL, here),
        (rows.t_cl_min, Var.T_SLACK, here),
        (rows.t_cl_max, Var.T_CL, here),
        (rows.t_cl_max, Var.T_SLACK, here),
        (rows.box_slack, Var.T_SLACK, here),
    ]
    for row in range(rows.fuel.start, rows.fuel.stop):
        entries += [(row, Var.FUEL, here), (row, Var.P_ENG, here), (row, Var.ON, here)]
    for row in range(rows.battery.start, rows.battery.stop):
        entries += [(row, Var.INTERNAL, here), (row, Var.P_ENG, here), (row, Var.ON, here)]
    return sorted(entries, key=lambda entry: entry[0])
