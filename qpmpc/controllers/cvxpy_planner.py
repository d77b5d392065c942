"""`mh-qp` written in cvxpy as a planner, for driving with a modified problem."""

from dataclasses import replace
from typing import Any

import cvxpy
import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.cvxpy_terms import checked_terms
from qpmpc.controllers.ramp import RampFloor
from qpmpc.controllers.realise import STAY_SHARE
from qpmpc.controllers.receding_horizon import Plan, Planner
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import InputError, QpmpcError
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.expectation import expectation
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.relaxation import relaxation_gap
from qpmpc.qp.rows import Var
from qpmpc.trip import Observation, Trip

cp: Any = cvxpy  # its type hints leave out half of its functions


class CvxpyPlanner(Planner):
    """Plans with the QP of `mh-qp` as a cvxpy program, solved to convergence each second.

    A subclass adds to the program in `terms`. The program must keep to cvxpy's rules for
    parametrised programs (DPP): it is compiled once, and only its parameters change from second
    to second.

    Parameters
    ----------
    trip, settings : as of `Planner`; the settings of `mh_qp` apply, except its solver's

    Attributes
    ----------
    solver : called by cvxpy; a class attribute is enough
    program : the program, with its expressions, objective and constraints
    model : its PWA curves
    preview : cuts the road ahead into stages; the first `preview.settings.short_stages` of them are
        the seconds ahead, the others are demand classes of blocks, not in the order of time
    """

    name = "mh-cvxpy"
    solver = "CLARABEL"

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        super().__init__(trip, settings)
        of_qp, vehicle = self.settings.mh_qp, trip.vehicle
        found: list[str] = cp.installed_solvers()
        if self.solver not in found:
            raise InputError(
                f"{self.name}: cvxpy has no solver {self.solver!r} here, only {', '.join(found)}"
            )
        self.solver_name = f"cvxpy {self.solver.lower()}"
        self.preview = trip.preview(of_qp.horizon)
        self.model = PwaModel.of(vehicle, of_qp.pwa)
        self.program = CvxpyTwin(vehicle, self.model, self.preview.count, of_qp.qp)
        self._own = checked_terms(self.name, self.program, self.terms)
        self.program.add(*self._own)
        self._explained, self._departs = False, True
        self._about: Linearisation | None = None
        self._ramp = RampFloor(vehicle)

    def terms(self, program: CvxpyTwin) -> tuple[Any, list[Any]]:
        """Return additions to the program: a cost in grams, and constraints.

        Parameters
        ----------
        program : its attributes are cvxpy expressions over the stages, see `CvxpyTwin`
        """
        return 0.0, []

    def set_program(self, seen: Observation) -> Stages:
        """Set the program's own parameters for a second; returns its stages."""
        about = self._about or Linearisation.constant(self.preview.count, seen.t_cl_degc)
        stages = self.preview.ahead(seen.step, seen.engine_on, seen.engine_for_s)
        self.program.update(stages, seen.soc, seen.t_cl_degc, about, seen.engine_on)
        return stages

    def solved(self) -> NDArray[np.float64]:
        """Solve the program as it is set; x as of `CvxpyTwin.solve`."""
        return self.program.solve(self.solver)

    def _require_values(self) -> None:
        for parameter in self.program.problem.parameters():
            if parameter.value is None:
                raise QpmpcError(
                    f"{self.name}: the parameter {parameter.name()!r} of terms has no value: set "
                    "it in plan, before super().plan(seen); cp.Parameter(name=..) gives it a name"
                )

    def _why(self) -> str:
        """Whether the terms leave no solution, said once in a run."""
        if self._explained or self.solver_fails or not self._own[1]:
            return ""
        self._explained = True
        return (
            ": without the constraints of terms there is a plan"
            if self.program.is_solvable_without(self._own[1], self.solver)
            else ""
        )

    def depart(self, seen: Observation) -> None:
        """Forget any earlier trip."""
        self.forget()
        self.expects, self._departs = None, True

    def forget(self) -> None:
        """Forget preview and last plan, as after a restart of the ECU under way."""
        self.preview.forget()
        self._about, self._explained = None, False

    def _departing(self, seen: Observation, first: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve once more about the coolant of the first plan, and keep what that expects."""
        layout = self.preview.settings
        self._about = Linearisation.about(first, seen.t_cl_degc, layout)
        stages = self.set_program(seen)
        try:
            x = self.solved()
        except QpmpcError:  # then by the first plan, and nothing is expected
            return first
        self.expects = expectation(self.trip, layout, self.model, stages, x)
        return x

    def plan(self, seen: Observation) -> Plan:
        """Solve the program of this second; without a solution there is no plan."""
        departs, self._departs = self._departs and seen.step == self.trip.start.step, False
        stages = self.set_program(seen)
        self._require_values()
        try:
            x = self.solved()
            if departs:
                x = self._departing(seen, x)
            if self.solver_fails:
                raise QpmpcError("failure injected")
        except QpmpcError as error:
            self._about = None
            return Plan.none(f"{error}{self._why()}")
        # short stages move up by one second until the next time
        layout = self.preview.settings
        self._about = Linearisation.about(x[self.preview.shift()], seen.t_cl_degc, layout)
        short = slice(layout.short_stages)
        arrival_s = stages.arrival_s(layout.short_stages)
        least_w = self._ramp.least_w(stages.seconds_w(layout.short_stages), seen.soc)
        fast_s = stages.fast_s(layout.short_stages, self.trip.vehicle)
        on_share, p_eng_w = x[short, Var.ON], x[short, Var.P_ENG]
        plan = Plan.of_means(on_share, p_eng_w, arrival_s, least_w, fast_s, STAY_SHARE)
        gap = relaxation_gap(self.trip.vehicle, self.model, stages, x)
        return replace(plan, relaxation_gap=gap)
