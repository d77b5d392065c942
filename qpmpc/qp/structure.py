"""The QP's sparsity pattern, stage by stage, from the table of rows."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from qpmpc.qp.rows import Entry, Row, Rows


class QpStructure:
    """Sparsity pattern of the QP over n stages; values are filled in by `StageQp`.

    Entries of A are kept as an array (n, entries): column `e` holds one entry of every stage, in
    row `entry_row[e]` and variable `entry_var[e]` of that stage, or of the stage before where
    `entry_before[e]`. `data(values)` puts them in the order of the CSC matrix.

    Parameters
    ----------
    stages : n
    rows : row layout

    Attributes
    ----------
    variables : of a stage
    """

    def __init__(self, stages: int, rows: Rows) -> None:
        self.stages = stages
        self.rows = rows
        self.variables = len(rows.table.variables)
        self.index: dict[tuple[int, Entry], int] = {}
        for row in rows.table.rows:
            for i in range(rows[row.name].start, rows[row.name].stop):
                self.index |= {(i, entry): len(self.index) + e for e, entry in enumerate(row.terms)}
        self.entry_row = np.array([row for row, _ in self.index])
        self.entry_var = np.array([entry.var for _, entry in self.index])
        self.entry_before = np.array([entry.before for _, entry in self.index])
        self.entry_start = np.flatnonzero(np.diff(self.entry_row, prepend=-1))
        k = np.arange(stages)[:, None]
        row = k * rows.count + self.entry_row
        column = (k - self.entry_before) * self.variables + self.entry_var
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
        return self.stages * self.rows.count, self.stages * self.variables

    def places(self, row: Row, entry: Entry) -> slice:
        """Columns of an entry in the array of entries, one for each piece of its row."""
        of_name = self.rows[row.name]
        first, last = (self.index[i, entry] for i in (of_name.start, of_name.stop - 1))
        return slice(first, last + 1, len(row.terms))

    def data(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Order the entries (n, entries) as the data vector of the CSC matrix."""
        return np.asarray(values.ravel()[self._order])

    @property
    def entries(self) -> int:
        """Length of A's data vector."""
        return len(self._order)

    def positions(self) -> sp.csc_matrix:
        """Return A with each entry's place in its data vector, counted from 1, as its value."""
        return self.matrix_of(np.arange(1.0, self.entries + 1.0))

    def matrix_of(self, data: NDArray[np.float64]) -> sp.csc_matrix:
        """Build A from its data vector; only set-up and tests need it."""
        return sp.csc_matrix((data, self._indices, self._indptr), shape=self.shape)
