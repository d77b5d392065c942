"""The forms of a QP that other solvers need: separate equalities, one-sided rows.

The rows of `lower <= A x <= upper` are sorted once, at set-up; each step only picks values out
of the data vector of A. If rows have become equalities, or lost a bound, in a step, they have to
be sorted anew.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
TINY = 1e-300  # keeps the full diagonal of P in the pattern where it is zero


def hessian_matrix(data: QpData) -> sp.csc_matrix:
    """P as a sparse matrix whose pattern is the full diagonal."""
    return sp.diags(np.maximum(data.hessian, TINY), format="csc")


class PickedRows:
    """Some rows of A, perhaps with their sign changed, filled from A's data vector.

    Parameters
    ----------
    structure : pattern of A
    rows : which rows, in the required order
    sign : +1 or -1 for each of them; all +1 if None
    """

    def __init__(self, structure: QpStructure, rows: Indices, sign: Floats | None = None) -> None:
        picked = structure.positions().tocsr()[rows].tocsc()
        picked.sort_indices()
        self.rows = rows
        self._from = (picked.data - 1.0).astype(np.intp)
        self._sign = (np.ones(len(rows)) if sign is None else sign)[picked.indices]
        self.shape, self.indices, self.indptr = picked.shape, picked.indices, picked.indptr

    def values(self, data: QpData) -> Floats:
        """Non-zeros of these rows, in CSC order."""
        values: Floats = data.a_data[self._from] * self._sign
        return values

    def matrix(self, data: QpData) -> sp.csc_matrix:
        """Return these rows of A."""
        return sp.csc_matrix((self.values(data), self.indices, self.indptr), shape=self.shape)


class TwoSided:
    """min 1/2 x'Px + q'x  s.t.  A x = b,  l <= G x <= u.

    Parameters
    ----------
    structure, data : the QP to sort
    """

    def __init__(self, structure: QpStructure, data: QpData) -> None:
        self._equal = data.lower == data.upper
        self.equalities = PickedRows(structure, np.flatnonzero(self._equal))
        self.inequalities = PickedRows(structure, np.flatnonzero(~self._equal))

    def fits(self, data: QpData) -> bool:
        """Whether the same rows are equalities as when they were sorted."""
        return np.array_equal(data.lower == data.upper, self._equal)

    def right_sides(self, data: QpData) -> tuple[Floats, Floats, Floats]:
        """Return b, l and u."""
        rest = self.inequalities.rows
        return data.lower[self.equalities.rows], data.lower[rest], data.upper[rest]

    def join(self, equality: Floats, inequality: Floats) -> Floats:
        """Put the duals of both parts into the order of the rows of A."""
        y = np.empty(len(self._equal))
        y[self.equalities.rows] = equality
        y[self.inequalities.rows] = inequality
        return y

    def part(self, y: Floats) -> tuple[Floats, Floats]:
        """Split duals in the order of the rows of A into those of both parts."""
        return y[self.equalities.rows], y[self.inequalities.rows]


class OneSided:
    """min 1/2 x'Px + q'x  s.t.  A x = b,  G x <= h: each side of a row is a separate row.

    `all` holds the rows of A and, below them, those of G.

    Parameters
    ----------
    structure, data : the QP to sort
    """

    def __init__(self, structure: QpStructure, data: QpData) -> None:
        self._masks = _masks(data)
        equal, above, below = (np.flatnonzero(mask) for mask in self._masks)
        sign = np.concatenate([np.ones(len(above)), -np.ones(len(below))])
        both = np.concatenate([above, below])
        self.equalities = PickedRows(structure, equal)
        self.inequalities = PickedRows(structure, both, sign)
        self.all = PickedRows(
            structure,
            np.concatenate([equal, both]),
            np.concatenate([np.ones(len(equal)), sign]),
        )
        self._above, self._below = above, below

    def fits(self, data: QpData) -> bool:
        """Whether each row has the same finite bounds as when they were sorted."""
        return all(np.array_equal(a, b) for a, b in zip(_masks(data), self._masks, strict=True))

    def right_sides(self, data: QpData) -> tuple[Floats, Floats]:
        """Return b and h."""
        h = np.concatenate([data.upper[self._above], -data.lower[self._below]])
        return data.lower[self.equalities.rows], h

    def join(self, equality: Floats, inequality: Floats) -> Floats:
        """Put the duals of both parts into the order of the rows of A."""
        y = np.zeros(len(self._masks[0]))
        y[self.equalities.rows] = equality
        y[self._above] += inequality[: len(self._above)]
        y[self._below] -= inequality[len(self._above) :]
        return y

    def part(self, y: Floats) -> tuple[Floats, Floats]:
        """Split duals in the order of the rows of A into those of both parts."""
        upper, lower = np.maximum(y[self._above], 0.0), np.maximum(-y[self._below], 0.0)
        return y[self.equalities.rows], np.concatenate([upper, lower])


class BoundsApart:
    """min 1/2 x'Px + q'x  s.t.  l <= A x <= u,  bounds on x: rows of one entry are the bounds.

    Parameters
    ----------
    structure : pattern of the QP

    Attributes
    ----------
    rows : those of several entries
    """

    def __init__(self, structure: QpStructure) -> None:
        position = structure.positions().tocsr()
        entries = np.diff(position.indptr)
        self._single = np.flatnonzero(entries == 1)
        self.rows = PickedRows(structure, np.flatnonzero(entries > 1))
        single = position[self._single]
        self._variable, self._from = single.indices, (single.data - 1.0).astype(np.intp)

    def row_bounds(self, data: QpData) -> tuple[Floats, Floats]:
        """Return l and u."""
        return data.lower[self.rows.rows], data.upper[self.rows.rows]

    def bounds(self, data: QpData) -> tuple[Floats, Floats]:
        """Return the bounds on x, those of rows with a negative entry the other way round."""
        factor = data.a_data[self._from]
        one, other = data.lower[self._single] / factor, data.upper[self._single] / factor
        low, high = np.full_like(data.q, -np.inf), np.full_like(data.q, np.inf)
        low[self._variable], high[self._variable] = np.minimum(one, other), np.maximum(one, other)
        return low, high

    def join(self, data: QpData, rows: Floats, bounds: Floats) -> Floats:
        """Put the duals of rows and bounds into the order of the rows of A."""
        y = np.empty_like(data.lower)
        y[self.rows.rows] = rows
        y[self._single] = bounds[self._variable] / data.a_data[self._from]
        return y


def _masks(data: QpData) -> tuple[Mask, Mask, Mask]:
    """Rows that are equalities, rows with an upper bound, rows with a lower bound."""
    equal = data.lower == data.upper
    return equal, ~equal & np.isfinite(data.upper), ~equal & np.isfinite(data.lower)
