"""The interface of QP backends: set up once, then solve with new values, warm-started."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure

Floats = NDArray[np.float64]
LARGEST_PLAUSIBLE = 1e6  # solver units are of order one; a failed solver leaves huge numbers


class Status(Enum):
    """Outcome of one solve."""

    SOLVED = "solved"
    ITERATION_LIMIT = "iteration limit"  # of fixed-iteration solvers: the normal outcome
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True)
class QpSolution:
    """Result of one solve, in solver units.

    Attributes
    ----------
    primal, dual : of the QP; a dual is above 0 at an active upper bound
    status : see `Status`
    iterations : of the solver's own kind
    solve_s, update_s : wall time of the solve alone and of the update of values before it, s;
        for reports only, never for decisions
    own_s : the solve by the solver's own clock, without the call from Python; nan where it has none
    """

    primal: Floats
    dual: Floats
    status: Status
    iterations: int
    solve_s: float
    update_s: float = 0.0
    own_s: float = math.nan

    @property
    def usable(self) -> bool:
        """Whether it may be used: solved or stopped at the limit, finite and in range."""
        return (
            self.status in (Status.SOLVED, Status.ITERATION_LIMIT)
            and bool(np.abs(self.primal).max() < LARGEST_PLAUSIBLE)
            and bool(np.abs(self.dual).max() < LARGEST_PLAUSIBLE)
        )


class QpSolver(Protocol):
    """A backend. It never changes the arrays it is given."""

    name: str

    def setup(self, structure: QpStructure, data: QpData) -> None:
        """Set up for the pattern of `structure`; called once per trip."""

    def solve(
        self, data: QpData, primal: Floats | None, dual: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Solve with new values, starting at the given primal and dual, or at zero where None.

        `cold` means that the start is far from the solution: a solver with an iteration limit
        may then use its larger one.
        """


def consistent(data: QpData) -> bool:
    """Whether the data are fit for a solver: no NaN, and no lower bound above its upper."""
    return bool(
        np.isfinite(data.q).all()
        and np.isfinite(data.a_data).all()
        and np.all(data.lower <= data.upper)
    )


def nothing(data: QpData) -> tuple[Floats, Floats]:
    """Primal and dual of a QP that has no solution, all nan."""
    return np.full_like(data.q, np.nan), np.full_like(data.lower, np.nan)


def failed(data: QpData) -> QpSolution:
    """Return the solution of a QP that was passed to no solver."""
    return QpSolution(*nothing(data), status=Status.FAILED, iterations=0, solve_s=0.0)
