"""One QP in three renderings, shown equal: numpy, cvxpy, generated C."""

import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.controller import InputBuilder
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import QpmpcError
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.solvers.base import Status
from qpmpc.solvers.piqp import Piqp
from qpmpc.trip import Trip
from qpmpc.verification.renderings.cvxpy_matrices import cvxpy_matrices
from qpmpc.verification.renderings.generated_qp import GeneratedQp
from qpmpc.verification.renderings.matrices import Matrices, difference, matrices_of
from qpmpc.verification.renderings.qp_cases import QpCase, random_cases, recorded_cases

Floats = NDArray[np.float64]

EXACT = 1e-10  # tolerance of PIQP on the product's QP
CLARABEL_OPTIONS = {  # cvxpy's, in its units: grams. Its default regularisation costs digits
    "tol_gap_abs": 1e-9,
    "tol_gap_rel": 1e-9,
    "tol_feas": 1e-9,
    "static_regularization_constant": 1e-10,
    "iterative_refinement_max_iter": 50,
    "iterative_refinement_abstol": 1e-14,
    "iterative_refinement_reltol": 1e-14,
}
C_TOLERANCE = 3e-8  # operator splitting: the last digits take as long as all others
C_RHO = 0.02  # to the last digit; measured: less takes longer in the worst case, more in the mean


@dataclass(frozen=True)
class Difference:
    """Difference of one rendering from the product's own QP.

    Attributes
    ----------
    matrices : largest difference of an entry, see `matrices.difference`
    optimum : |J - J*| / (1 + |J*|) of its optimum, J* by PIQP on the product's matrices
    violation : of the product's rows by that optimum, in solver units
    """

    matrices: float
    optimum: float
    violation: float


@dataclass(frozen=True)
class Equivalence:
    """Differences over many cases, one dictionary per case: by rendering."""

    cases: list[dict[str, Difference]]

    def worst(self) -> dict[str, Difference]:
        """Return the largest of each difference; nan where any is nan."""
        return {
            name: Difference(
                *np.max([list(asdict(case[name]).values()) for case in self.cases], axis=0).tolist()
            )
            for name in self.cases[0]
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, ready for JSON."""
        worst = {name: asdict(found) for name, found in self.worst().items()}
        return {"cases": len(self.cases), "worst": worst}


class Renderings:
    """The QP of one trip in its renderings: `cvxpy` and, with a C compiler, `c`.

    All are made from one table of rows, so this compares the renderings with each other; the
    table itself is compared with the equations by `independent.stage_program`. Each has its own
    solver: cvxpy calls Clarabel on its compiled program, the generated C iterates to convergence,
    and the product's matrices go to PIQP.

    Parameters
    ----------
    trip : vehicle and cycle
    settings : of all controllers; those of `mh_qp` apply

    Raises
    ------
    QpmpcError
        If Clarabel or PIQP is not installed.
    """

    def __init__(self, trip: Trip, settings: ControllerSettings) -> None:
        chosen, vehicle = settings.mh_qp, trip.vehicle
        model = PwaModel.of(vehicle, chosen.pwa)
        self.preview = trip.preview(chosen.horizon)
        stages = self.preview.count
        self.qp = StageQp(vehicle, model, stages, chosen.qp, chosen.scaling)
        self.twin = CvxpyTwin(vehicle, model, stages, chosen.qp, regularised=True)
        self.generated: GeneratedQp | None = None
        if compiler() is not None:
            blocks = chosen.horizon.block_count(trip.forecast.steps)
            to_the_end = settings.with_settings({"mh_qp.admm.rho": C_RHO})
            values = values_of(vehicle, to_the_end.mh_qp, settings.rule_based, blocks)
            self.generated = GeneratedQp(values, InputBuilder(self.preview.receive))
        self._solver = Piqp(EXACT)
        self._is_set_up = False

    def inputs(self, case: QpCase) -> tuple[Stages, float, float, Linearisation, bool]:
        """Return the data for updating the renderings in Python."""
        seen = case.seen
        about = Linearisation.about(case.x, seen.t_cl_degc, self.preview.settings)
        source = self.preview.source
        stages = source.held(source.at(seen.step), seen.engine_on, seen.engine_for_s)
        return stages, seen.soc, seen.t_cl_degc, about, seen.engine_on

    def compare(self, case: QpCase) -> dict[str, Difference]:
        """Build and solve one case in all renderings."""
        data = self.qp.update(*self.inputs(case))
        column = data.scaling.column
        ours = matrices_of(self.qp.structure, data)
        best = ours.value(data.scaling.primal(self._solve(data)))
        made: dict[str, Callable[[QpCase, QpData], tuple[Matrices, Floats]]] = {
            "cvxpy": self._by_cvxpy,
        }
        if self.generated is not None:
            made["c"] = self._by_c
        found = {}
        for name, make in made.items():
            theirs, x = make(case, data)
            found[name] = Difference(
                matrices=difference(ours, theirs, column),
                optimum=abs(ours.value(x) - best) / (1.0 + abs(best)),
                violation=ours.violation(x, column),
            )
        return found

    def _solve(self, data: QpData) -> Floats:
        if not self._is_set_up:
            self._solver.setup(self.qp.structure, data)
            self._is_set_up = True
        solution = self._solver.solve(data, None, None)
        return solution.primal if solution.status is Status.SOLVED else np.full_like(data.q, np.nan)

    def _by_cvxpy(self, case: QpCase, data: QpData) -> tuple[Matrices, Floats]:
        self.twin.update(*self.inputs(case), data.scaling)
        matrices = cvxpy_matrices(self.twin)
        with warnings.catch_warnings(action="ignore"):  # its accuracy is measured
            try:
                return matrices, self.twin.solve("CLARABEL", **CLARABEL_OPTIONS).ravel()
            except QpmpcError:
                return matrices, np.full_like(data.q, np.nan)

    def _by_c(self, case: QpCase, _: QpData) -> tuple[Matrices, Floats]:
        assert self.generated is not None
        matrices = self.generated.update(case.seen, case.x)
        return matrices, self.generated.solve(C_TOLERANCE)


def check_equivalence(
    trip: Trip,
    every: int = 5,
    random: int = 100,
    seed: int = 1,
    settings: ControllerSettings | None = None,
) -> Equivalence:
    """Compare the renderings on recorded and random cases of one trip.

    Parameters
    ----------
    trip : source of the cases
    every : one recorded case per this many steps
    random, seed : number of random cases, and their seed
    settings : of all controllers

    Raises
    ------
    QpmpcError
        If a solver is not installed.
    """
    chosen = settings or ControllerSettings()
    renderings = Renderings(trip, chosen)
    cases = [
        *recorded_cases(trip, chosen, every),
        *random_cases(trip, renderings.preview.count, random, seed),
    ]
    return Equivalence([renderings.compare(case) for case in cases])
