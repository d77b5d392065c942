"""Three renderings of one QP, shown equal: numpy, cvxpy, and CasADi by differentiation."""

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.preview.stages import StageBuilder, Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.qp.structure import VARS, Var
from qpmpc.simulate import simulate
from qpmpc.solvers.base import Status
from qpmpc.solvers.piqp import Piqp
from qpmpc.solvers.timed import require
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant
from qpmpc.verification.casadi_qp import CasadiQp
from qpmpc.verification.cvxpy_matrices import cvxpy_matrices
from qpmpc.verification.matrices import Matrices, difference, matrices_of

Floats = NDArray[np.float64]

EXACT = 1e-10  # tolerance of the product's QP, solved by PIQP
CVXPY_OPTIONS = {"eps_abs": 1e-9, "eps_rel": 1e-9}  # of PIQP, in cvxpy's units: grams
DAQP_OPTIONS = {"primal_tol": 1e-9, "dual_tol": 1e-9, "iter_limit": 10_000}
PROXIMAL_WEIGHTS = (1e-4, 1e-3, 1e-2)  # the next where DAQP cycles with one; same optimum
EQUALITY = 5  # DAQP's name for it
# T^, F^, E^, T at start and end of a random case
RANDOM_ABOUT = ((20.0, 90.0), (0.0, 3.0), (0.0, 40e3), (20.0, 90.0), (20.0, 90.0))


@dataclass(frozen=True)
class QpCase:
    """What one QP is made from.

    Attributes
    ----------
    stages : the road ahead
    soc, t_cl_degc : state
    about : linearisation point
    """

    stages: Stages
    soc: float
    t_cl_degc: float
    about: Linearisation


@dataclass(frozen=True)
class CaseDifference:
    """Differences of one case, each against the product's own QP.

    Attributes
    ----------
    cvxpy_matrices, casadi_matrices : largest difference of an entry, see `matrices.difference`
    cvxpy_optimum, casadi_optimum : |J - J*| / (1 + |J*|) of their optima, J* by PIQP on the
        product's matrices: cvxpy calls PIQP on what it compiles, CasADi's matrices go to DAQP, an
        active-set method
    cvxpy_violation, casadi_violation : of the product's rows by those results, in solver units
    """

    cvxpy_matrices: float
    casadi_matrices: float
    cvxpy_optimum: float
    casadi_optimum: float
    cvxpy_violation: float
    casadi_violation: float


@dataclass(frozen=True)
class Equivalence:
    """Differences over many cases."""

    cases: list[CaseDifference]

    def worst(self) -> CaseDifference:
        """Return the largest of each difference."""
        rows = np.array([list(asdict(case).values()) for case in self.cases])
        return CaseDifference(*rows.max(axis=0).tolist())

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, ready for JSON."""
        return {"cases": len(self.cases), "worst": asdict(self.worst())}


class Renderings:
    """The QP of one trip in its three renderings.

    Parameters
    ----------
    vehicle : plant parameters
    preview : cuts the trip into stages
    settings : of all controllers; those of `mh_qp` count

    Raises
    ------
    QpmpcError
        If CasADi, PIQP or DAQP is not installed.
    """

    def __init__(
        self, vehicle: Vehicle, preview: StageBuilder, settings: ControllerSettings
    ) -> None:
        chosen = settings.mh_qp
        model = PwaModel.of(vehicle, chosen.pwa)
        self.qp = StageQp(vehicle, model, preview.count, chosen.qp, chosen.scaling)
        self.twin = CvxpyTwin(vehicle, model, preview.count, chosen.qp)
        self.casadi = CasadiQp(vehicle, model, preview.count, chosen.qp)
        self._solver = Piqp(EXACT)
        self._is_set_up = False

    def compare(self, case: QpCase) -> CaseDifference:
        """Build and solve one case in all renderings."""
        data = self.qp.update(case.stages, case.soc, case.t_cl_degc, case.about)
        column = data.scaling.column
        ours = matrices_of(self.qp.structure, data)
        best = ours.value(data.scaling.primal(self._solve(data)))

        self.twin.update(case.stages, case.soc, case.t_cl_degc, case.about, data.scaling)
        with warnings.catch_warnings(action="ignore"):  # how accurate it is, is measured below
            by_cvxpy = self.twin.solve("PIQP", **CVXPY_OPTIONS).ravel()

        weight = np.sqrt(self.qp.settings.regularisation / data.scaling.cost)
        smoothing = (weight / column).reshape(-1, VARS)
        smoothing[:, [Var.SOC, Var.T_CL]] = 0.0
        theirs = self.casadi.matrices(case.stages, case.soc, case.t_cl_degc, case.about, smoothing)
        by_casadi = self._solve_dense(theirs, column, data.scaling.cost)
        return CaseDifference(
            cvxpy_matrices=difference(ours, cvxpy_matrices(self.twin), column),
            casadi_matrices=difference(ours, theirs, column),
            cvxpy_optimum=abs(ours.value(by_cvxpy) - best) / (1.0 + abs(best)),
            casadi_optimum=abs(ours.value(by_casadi) - best) / (1.0 + abs(best)),
            cvxpy_violation=ours.violation(by_cvxpy, column),
            casadi_violation=ours.violation(by_casadi, column),
        )

    def _solve(self, data: QpData) -> Floats:
        if not self._is_set_up:
            self._solver.setup(self.qp.structure, data)
            self._is_set_up = True
        solution = self._solver.solve(data, None, None)
        return solution.z if solution.status is Status.SOLVED else np.full_like(data.q, np.nan)

    def _solve_dense(self, m: Matrices, column: Floats, cost: float) -> Floats:
        """Optimum by DAQP, in units that make its tolerances mean the same as the product's."""
        rows = np.vstack([m.equal, m.upper]) * column
        norm = np.linalg.norm(rows, axis=1)
        high = np.concatenate([m.equal_to, m.upper_to]) / norm
        is_equal = np.arange(len(high)) < len(m.equal_to)
        solve = require("daqp", "daqp").solve
        for weight in PROXIMAL_WEIGHTS:
            z, _, flag, _ = solve(
                cost * m.hessian * np.multiply.outer(column, column),
                cost * m.gradient * column,
                rows / norm[:, None],
                high,
                np.where(is_equal, high, -np.inf),
                np.where(is_equal, EQUALITY, 0).astype(np.int32),
                eps_prox=weight,
                **DAQP_OPTIONS,
            )
            if flag > 0:
                return np.array(z) * column
        return np.full_like(column, np.nan)


def recorded_cases(
    cycle: Cycle, vehicle: Vehicle, preview: StageBuilder, settings: ControllerSettings, every: int
) -> Iterator[QpCase]:
    """Cases met by `mh-qp` on the road: each `every`-th step, about the plan of the step before."""
    plant, truth = Plant(vehicle), Trace.of(cycle, vehicle)
    driver = MhQp("mh-qp", plant, truth, truth, settings.mh_qp, settings.rule_based)
    run = simulate(cycle, driver, vehicle).trajectory
    again = MhQp("mh-qp", plant, truth, truth, settings.mh_qp, settings.rule_based)
    for step in range(cycle.steps):
        soc, t_cl_degc = float(run.soc[step]), float(run.t_cl_degc[step])
        x = again.planner.solve(step, soc, t_cl_degc).x
        if step % every == 0:
            about = Linearisation.about(x, t_cl_degc, preview.settings)
            yield QpCase(preview.at(step), soc, t_cl_degc, about)


def random_cases(
    preview: StageBuilder, vehicle: Vehicle, count: int, seed: int
) -> Iterator[QpCase]:
    """Cases that no trip may ever meet: any step, any state, any linearisation point."""
    rng = np.random.default_rng(seed)
    battery = vehicle.battery
    for _ in range(count):
        yield QpCase(
            stages=preview.at(int(rng.integers(preview.steps))),
            soc=float(rng.uniform(battery.soc_min, battery.soc_max)),
            t_cl_degc=float(rng.uniform(20.0, 90.0)),
            about=Linearisation(
                *(rng.uniform(low, high, preview.count) for low, high in RANDOM_ABOUT)
            ),
        )


def check_equivalence(
    cycle: Cycle,
    vehicle: Vehicle,
    every: int = 5,
    random: int = 100,
    seed: int = 1,
    settings: ControllerSettings | None = None,
) -> Equivalence:
    """Compare the renderings on recorded and random cases of one trip.

    Parameters
    ----------
    cycle, vehicle : the trip
    every : one recorded case each so many steps
    random, seed : how many random cases, and their seed
    settings : of all controllers

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """
    chosen = settings or ControllerSettings()
    truth = Trace.of(cycle, vehicle)
    preview = StageBuilder(vehicle, truth, truth, chosen.mh_qp.horizon)
    renderings = Renderings(vehicle, preview, chosen)
    cases: Iterable[QpCase] = [
        *recorded_cases(cycle, vehicle, preview, chosen, every),
        *random_cases(preview, vehicle, random, seed),
    ]
    return Equivalence([renderings.compare(case) for case in cases])
