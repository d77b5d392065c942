"""The twin as cvxpy passes it to a solver, transformed back to the QP's own variables."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from qpmpc.qp.cvxpy_twin import UNIT, CvxpyTwin
from qpmpc.verification.renderings.matrices import Matrices

Floats = NDArray[np.float64]


def cvxpy_matrices(twin: CvxpyTwin) -> Matrices:
    """Matrices of the twin at its last update, as compiled by cvxpy for a conic solver.

    cvxpy adds its own variables: the state now, which a row fixes, and copies of expressions
    under a square. Both are eliminated.
    """
    data, _, _ = twin.problem.get_problem_data("CLARABEL")
    columns = data["param_prob"].var_id_to_col
    shape = twin.stages, len(twin.variables)
    ours, unit = np.empty(shape, dtype=np.intp), np.empty(shape)
    for var in twin.variables:
        ours[:, var] = columns[twin.variables[var].id] + np.arange(twin.stages)
        unit[:, var] = UNIT[var]
    return _reduced(data, ours.ravel(), unit.ravel())


def _reduced(data: dict[str, Any], ours: NDArray[np.intp], unit: Floats) -> Matrices:
    """Express every other variable by ours, y = M x + m, and put it in."""
    a, b, q, p = data["A"].toarray(), data["b"], data["c"], data["P"].toarray()
    count = data["dims"].zero
    others = np.setdiff1d(np.arange(a.shape[1]), ours)
    # Rows that define one of the others: it alone, or it and ours. The rest are ours.
    left = a[:count]
    touched = (left[:, others] != 0.0).sum(axis=1)
    alone = (left != 0.0).sum(axis=1) == 1
    pins = np.flatnonzero(alone & (touched == 1))
    pinned = others[(left[np.ix_(pins, others)] != 0.0).argmax(axis=1)]
    copies = np.setdiff1d(others, pinned)
    defining = np.flatnonzero((left[:, copies] != 0.0).any(axis=1))
    rows = np.concatenate([pins, defining])
    if len(rows) != len(others):
        raise RuntimeError("cvxpy has compiled the twin into an unknown form")
    factor = splu(csc_matrix(left[np.ix_(rows, others)]))
    m, offset = -factor.solve(left[np.ix_(rows, ours)]), factor.solve(b[rows])
    reduced = a[:, ours] + a[:, others] @ m
    right = b - a[:, others] @ offset
    own = np.setdiff1d(np.arange(count), rows)
    lift = np.eye(a.shape[1])[:, ours]
    lift[others] = m
    constant = np.zeros(a.shape[1])
    constant[others] = offset
    upper = slice(count, None)
    return Matrices(
        gradient=(lift.T @ (q + p @ constant)) / unit,
        hessian=(lift.T @ p @ lift) / np.multiply.outer(unit, unit),
        equal=reduced[own] / unit,
        equal_to=right[own],
        upper=reduced[upper] / unit,
        upper_to=right[upper],
    )
