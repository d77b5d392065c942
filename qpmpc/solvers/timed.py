"""The base of all tolerance-driven backends: data update and solve, timed separately."""

import math
from abc import ABC, abstractmethod
from importlib import import_module
from time import perf_counter
from types import ModuleType
from typing import NamedTuple

import numpy as np

from qpmpc.errors import InputError
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, QpSolution, Status, consistent, failed

DEFAULT_TOLERANCE = 1e-8
EXTRA = "verification"  # the extra of qpmpc-iptm that installs these solvers


class Outcome(NamedTuple):
    """A backend's result of one solve; `own_s` as of `QpSolution`."""

    primal: Floats
    dual: Floats
    status: Status
    iterations: int
    own_s: float = math.nan


class TimedSolver(ABC):
    """A backend that iterates until the KKT residuals are within a tolerance.

    Parameters
    ----------
    tolerance : on primal and dual residual and duality gap, in solver units, as the solver
        measures them
    iterations : at most, of the solver's own kind; its own limit if None

    Attributes
    ----------
    max_iterations : that limit
    starts_warm : whether a start, or what is in memory, makes a difference
    limit : the one in force
    capped : whether it is a given one; a result at such a limit is what was asked for

    Raises
    ------
    InputError
        If the solver's package is not installed, the tolerance is not in (0, 1), or there are
        fewer iterations than one.
    """

    name: str
    package: str
    max_iterations: int
    starts_warm = False

    def __init__(self, tolerance: float = DEFAULT_TOLERANCE, iterations: int | None = None) -> None:
        if not 0.0 < tolerance < 1.0:
            raise InputError(f"solver tolerance must be between 0 and 1 (given: {tolerance})")
        if iterations is not None and iterations < 1:
            raise InputError(f"solver iterations must be 1 or more (given: {iterations})")
        self.tolerance = tolerance
        self.capped = iterations is not None
        self.limit = self.max_iterations if iterations is None else iterations
        self.module = require(self.package, self.name)
        self._structure: QpStructure | None = None

    def setup(self, structure: QpStructure, data: QpData) -> None:
        """Set up for the pattern of `structure`."""
        self._structure = structure
        self._start(structure, data)

    def solve(
        self, data: QpData, primal: Floats | None, dual: Floats | None, cold: bool = False
    ) -> QpSolution:
        """Update the values, then solve to the tolerance; `cold` makes no difference."""
        if self._structure is None:
            raise RuntimeError("setup must come before solve")
        if not consistent(data):
            return failed(data)
        start = perf_counter()
        if self._fits(data):
            self._update(data)
        else:
            self._start(self._structure, data)
        updated = perf_counter()
        outcome = self._run(data, primal, dual)
        done = perf_counter()
        return QpSolution(
            primal=outcome.primal,
            dual=outcome.dual,
            status=outcome.status,
            iterations=outcome.iterations,
            solve_s=done - updated,
            update_s=updated - start,
            own_s=outcome.own_s,
        )

    @abstractmethod
    def _start(self, structure: QpStructure, data: QpData) -> None:
        """Set up anew."""

    @abstractmethod
    def _fits(self, data: QpData) -> bool:
        """Whether the set-up can take these data by an update."""

    @abstractmethod
    def _update(self, data: QpData) -> None:
        """Replace the values."""

    @abstractmethod
    def _run(self, data: QpData, primal: Floats | None, dual: Floats | None) -> Outcome:
        """Solve the QP set up last; `data` are the same again."""


def require(package: str, solver: str) -> ModuleType:
    """Import a solver's package.

    Raises
    ------
    InputError
        If it is not installed; the message gives the command to install it.
    """
    try:
        return import_module(package)
    except ImportError as error:
        raise InputError(
            f"solver {solver!r} needs the package {package!r}, which is not installed: "
            f"pip install 'qpmpc-iptm[{EXTRA}]'"
        ) from error


def array(values: object) -> Floats:
    """Copy a solver's result: most solvers reuse the memory in the next solve."""
    return np.array(values, dtype=float)
