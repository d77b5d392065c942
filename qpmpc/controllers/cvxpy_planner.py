"""`mh-qp` written in cvxpy as a planner, for driving with a modified problem."""

from typing import Any

import cvxpy

from qpmpc.controllers.ramp import RampFloor
from qpmpc.controllers.receding_horizon import Plan, Planner
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import InputError, QpmpcError
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import Var
from qpmpc.trip import Observation, Trip

cp: Any = cvxpy  # its type hints leave out half of its functions


class CvxpyPlanner(Planner):
    """Plans with the QP of `mh-qp` as a cvxpy program, solved to convergence each second.

    A subclass adds to the program in `terms`. The program must keep to cvxpy's rules for
    parametrised programs (DPP), or it is compiled anew each second.

    Parameters
    ----------
    trip, settings : as of `Planner`; the settings of `mh_qp` apply, except its solver's

    Attributes
    ----------
    solver : called by cvxpy; a class attribute is enough
    program : the program, with its expressions, objective and constraints
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
        model = PwaModel.of(vehicle, of_qp.pwa)
        self.program = CvxpyTwin(vehicle, model, self.preview.count, of_qp.qp)
        added = self.terms(self.program)
        if not (isinstance(added, tuple) and len(added) == 2):
            raise QpmpcError(f"{self.name}: terms returned {added!r}, not (cost, [constraints])")
        self.program.add(*added)
        if not self.program.problem.is_dcp():
            raise QpmpcError(f"{self.name}: what terms adds is not convex by cvxpy's rules")
        self._about: Linearisation | None = None
        self._ramp = RampFloor(vehicle)

    def terms(self, program: CvxpyTwin) -> tuple[Any, list[Any]]:
        """Return additions to the program: a cost in grams, and constraints.

        Parameters
        ----------
        program : its attributes are cvxpy expressions over the stages, see `CvxpyTwin`
        """
        return 0.0, []

    def depart(self, seen: Observation) -> None:
        """Forget any earlier trip."""
        self.forget()

    def forget(self) -> None:
        """Forget preview and last plan, as after a restart of the ECU under way."""
        self.preview.forget()
        self._about = None

    def plan(self, seen: Observation) -> Plan:
        """Solve the program of this second; without a solution there is no plan."""
        about = self._about or Linearisation.constant(self.preview.count, seen.t_cl_degc)
        stages = self.preview.at(seen.step)
        self.program.update(stages, seen.soc, seen.t_cl_degc, about, seen.engine_on)
        try:
            x = self.program.solve(self.solver)
            if self.solver_fails:
                raise QpmpcError("failure injected")
        except QpmpcError as error:
            self._about = None
            return Plan.none(str(error))
        # short stages move up by one second until the next time
        layout = self.preview.settings
        self._about = Linearisation.about(x[self.preview.shift()], seen.t_cl_degc, layout)
        short = slice(layout.short_stages)
        arrival_s = stages.arrival_s(layout.short_stages)
        least_w = self._ramp.least_w(stages.seconds_w(layout.short_stages), seen.soc)
        fast_s = stages.fast_s(layout.short_stages, self.trip.vehicle)
        return Plan.of_means(x[short, Var.ON], x[short, Var.P_ENG], arrival_s, least_w, fast_s)
