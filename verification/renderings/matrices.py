"""A QP as plain matrices in SI units, and the difference of two for any order of rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure

Floats = NDArray[np.float64]

SAME = 1e-9  # distance of two rows of unit norm that are one and the same
# Rows of hundreds of entries are searched for by a few sums of them: unequal rows share all of
# these by chance only, which would show as a difference, never hide one.
SUMS, SEED = 6, 1


@dataclass(frozen=True)
class Matrices:
    """min 1/2 x'Px + q'x  s.t.  equal x = equal_to,  upper x <= upper_to, in grams and SI units.

    x holds the variables stage by stage, in the order of `Var`. P may be dense.
    """

    gradient: Floats
    hessian: Floats
    equal: Floats
    equal_to: Floats
    upper: Floats
    upper_to: Floats

    def value(self, x: Floats) -> float:
        """Cost at x, g, but for its constant."""
        return float(0.5 * x @ self.hessian @ x + self.gradient @ x)

    def violation(self, x: Floats, column: Floats) -> float:
        """Largest violation of a row at x, rows of unit norm in the units `column`."""
        equal, equal_to = _unit_rows(self.equal, self.equal_to, column)
        upper, upper_to = _unit_rows(self.upper, self.upper_to, column)
        z = x / column
        return float(max(np.abs(equal @ z - equal_to).max(), (upper @ z - upper_to).max()))


def matrices_of(structure: QpStructure, data: QpData) -> Matrices:
    """Undo the scaling of the product's QP."""
    scaling = data.scaling
    return matrices_from(
        structure.matrix_of(data.a_data).toarray() / scaling.row[:, None] / scaling.column,
        data.lower / scaling.row,
        data.upper / scaling.row,
        data.hessian / scaling.column**2 / scaling.cost,
        data.q / scaling.column / scaling.cost,
    )


def matrices_from(
    a: Floats, lower: Floats, upper: Floats, curvature: Floats, gradient: Floats
) -> Matrices:
    """Give each side of the rows lower <= a x <= upper its own row; curvature: diagonal of P."""
    equal = lower == upper
    above, below = ~equal & np.isfinite(upper), ~equal & np.isfinite(lower)
    return Matrices(
        gradient=gradient,
        hessian=np.diag(curvature),
        equal=a[equal],
        equal_to=lower[equal],
        upper=np.concatenate([a[above], -a[below]]),
        upper_to=np.concatenate([upper[above], -lower[below]]),
    )


def difference(one: Matrices, other: Matrices, column: Floats) -> float:
    """Largest difference of any entry of cost and rows.

    Variables are counted in the units `column`; rows are brought to unit norm, and each is
    compared with the nearest row of the other program. Gradient and Hessian are relative to their
    largest entries. The result is infinite if the numbers of rows differ, or two rows that differ
    share a partner.
    """
    worst = _relative(one.gradient * column, other.gradient * column)
    outer = np.multiply.outer(column, column)
    worst = max(worst, _relative(one.hessian * outer, other.hessian * outer))
    for kind in ("equal", "upper"):
        rows = [
            np.column_stack(_unit_rows(getattr(m, kind), getattr(m, f"{kind}_to"), column))
            for m in (one, other)
        ]
        if kind == "equal":
            rows = [_signed(r) for r in rows]
        worst = max(worst, _unmatched(*rows))
    return float(worst)


def _relative(one: Floats, other: Floats) -> float:
    size = max(float(np.abs(one).max()), float(np.abs(other).max()))
    return float(np.abs(one - other).max()) / size if size else 0.0


def _unit_rows(rows: Floats, right: Floats, column: Floats) -> tuple[Floats, Floats]:
    scaled = rows * column
    norm = np.linalg.norm(scaled, axis=1)
    return scaled / norm[:, None], right / norm


def _signed(rows: Floats) -> Floats:
    """Equalities have no sign: make the largest entry of the left side positive."""
    largest = np.abs(rows[:, :-1]).argmax(axis=1)
    return np.asarray(rows * np.sign(rows[np.arange(len(rows)), largest])[:, None])


def _unmatched(one: Floats, other: Floats) -> float:
    (one, times), (other, other_times) = _distinct(one), _distinct(other)
    if len(one) != len(other):
        return float("inf")
    _, partner = KDTree(_sums(other)).query(_sums(one))
    if len(np.unique(partner)) != len(one) or np.any(times != other_times[partner]):
        return float("inf")
    return float(np.abs(one - other[partner]).max())


def _distinct(rows: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Rows that differ, and how often each occurs: a stage may have the same row twice."""
    times, first = np.ones(len(rows), dtype=np.intp), np.arange(len(rows))
    for i, j in sorted(KDTree(_sums(rows)).query_pairs(SAME)):
        if first[j] == j and np.linalg.norm(rows[i] - rows[j]) <= SAME:
            first[j] = first[i]
            times[first[i]] += 1
    kept = first == np.arange(len(rows))
    return rows[kept], times[kept]


def _sums(rows: Floats) -> Floats:
    """Coordinates of the rows along random unit directions at right angles: never further apart."""
    directions = np.random.default_rng(SEED).standard_normal((rows.shape[1], SUMS))
    return np.asarray(rows @ np.linalg.qr(directions)[0])
