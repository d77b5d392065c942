"""Whether a QP has a feasible point at all, for solvers that do not report it."""

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure

FEASIBILITY_TOLERANCE = 1e-7  # in solver units, of the linear program


def is_infeasible(structure: QpStructure, data: QpData) -> bool:
    """Return whether min t s.t. lower - t <= A x <= upper + t, t >= 0 stays above zero."""
    variables = structure.shape[1]
    a = structure.matrix_of(data.a_data)
    above, below = np.isfinite(data.upper), np.isfinite(data.lower)
    left = sp.vstack([a[above], -a[below]])
    left = sp.hstack([left, -np.ones((left.shape[0], 1))], format="csc")
    result = linprog(
        np.append(np.zeros(variables), 1.0),
        A_ub=left,
        b_ub=np.concatenate([data.upper[above], -data.lower[below]]),
        bounds=[(None, None)] * variables + [(0.0, None)],
        method="highs",
    )
    return bool(result.status == 0 and result.fun > FEASIBILITY_TOLERANCE)
