"""KKT residuals of a QP, recomputed from its data without a solver."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class KktResiduals:
    """How far (z, y) is from optimal, largest entry of each condition, in solver units.

    Attributes
    ----------
    primal : lower <= A z <= upper
    dual : P z + q + A'y = 0
    complementarity : y+ (upper - A z) = 0 and y- (A z - lower) = 0
    """

    primal: float
    dual: float
    complementarity: float

    @property
    def largest(self) -> float:
        """The worst of the three."""
        return max(self.primal, self.dual, self.complementarity)


def kkt_residuals(structure: QpStructure, data: QpData, z: Floats, y: Floats) -> KktResiduals:
    """Compute the residuals of the KKT conditions at (z, y), y > 0 at an active upper bound.

    A dual on a side that has no bound counts in full as a complementarity error.
    """
    a = structure.matrix_of(data.a_data)
    row = a @ z
    above, below = np.maximum(y, 0.0), np.maximum(-y, 0.0)
    slack_above = np.where(np.isfinite(data.upper), data.upper - row, 1.0)
    slack_below = np.where(np.isfinite(data.lower), row - data.lower, 1.0)
    return KktResiduals(
        primal=float(max((row - data.upper).max(), (data.lower - row).max(), 0.0)),
        dual=float(np.abs(data.hessian * z + data.q + a.T @ y).max()),
        complementarity=float(
            max(np.abs(above * slack_above).max(), np.abs(below * slack_below).max())
        ),
    )


def objective(data: QpData, z: Floats) -> float:
    """1/2 z'Pz + q'z."""
    return float(0.5 * z @ (data.hessian * z) + data.q @ z)
