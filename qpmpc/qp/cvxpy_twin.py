"""The QP in cvxpy, from the table of rows, for changes and prototypes."""

import ast
from collections.abc import Sequence
from types import CodeType
from typing import Any, NamedTuple

import cvxpy
import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import InputError, QpmpcError
from qpmpc.names import unknown
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.expressions import code_of, expression
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.quantities import Quantities
from qpmpc.qp.rows import Entry, Row, Var, table_of
from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

cp: Any = cvxpy  # its type hints omit half of its functions

# SI units per unit of cvxpy's variables, so that solvers get numbers of order one
UNIT = {
    Var.SOC: 0.01,
    Var.T_CL: 1.0,
    Var.P_ENG: 10e3,
    Var.ON: 1.0,
    Var.FUEL: 1.0,
    Var.INTERNAL: 10e3,
    Var.T_SLACK: 1.0,
    Var.START: 1.0,
}


METHODS = ("given", "state")  # that a user calls in `terms`
# Known of a stage and never negative, so that a convex function may be weighed by it.
NONNEGATIVE = {"duration_s", "speed_mps", "must_share", "rises"}


class State(NamedTuple):
    """A state that a user added.

    Attributes
    ----------
    end, before : at the end of each stage and of the one before it, shape (n,)
    now : parameter with its value now, to be set each second
    """

    end: Any
    before: Any
    now: Any


class CvxpyTwin:
    """The multi-horizon QP as a disciplined parametrised program: compiled once, then updated.

    min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + slack

    over the variables and rows of `qpmpc.qp.rows`, in SI units. Its attributes are cvxpy
    expressions: build a changed `cvxpy.Problem` from `objective` and `constraints` to try an
    idea. Between two updates only parameters change.

    Parameters
    ----------
    vehicle, model : plant parameters and the PWA curves made from them
    stages : number of stages n
    settings : weights and margins
    regularised : with the regularisation of `StageQp`, for comparisons with it

    Attributes
    ----------
    soc, t_cl_degc, p_eng_w, on, fuel_g_per_s, internal_w, t_slack_k, starts : expressions, shape
        (n,): SOC and coolant at the end of each stage, the others means over it, starts in it. A
        vehicle whose engine starts at no cost has no `starts`
    rows : constraints by the name of their row
    objective, constraints, problem : the program
    """

    def __init__(
        self,
        vehicle: Vehicle,
        model: PwaModel,
        stages: int,
        settings: QpSettings | None = None,
        regularised: bool = False,
    ) -> None:
        self.vehicle, self.model, self.stages = vehicle, model, stages
        self.settings = settings or QpSettings()
        self.table = table_of(vehicle.engine)
        numbers = qp_parameters(vehicle, model, self.settings, ScalingSettings())
        self._quantities = Quantities(numbers, vehicle, model, stages)
        self._parameters: list[tuple[Any, CodeType, int]] = []
        names = {var: var.name.lower() for var in self.table.variables}
        self.variables = {var: cp.Variable(stages, name=name) for var, name in names.items()}
        x = {var: UNIT[var] * variable for var, variable in self.variables.items()}
        self.soc, self.t_cl_degc = x[Var.SOC], x[Var.T_CL]
        self.p_eng_w, self.on = x[Var.P_ENG], x[Var.ON]
        self.fuel_g_per_s, self.internal_w = x[Var.FUEL], x[Var.INTERNAL]
        self.t_slack_k = x[Var.T_SLACK]
        if self.table.has_start:
            self.starts = x[Var.START]
        # the state now is a variable with one value, as products of parameters are not DPP
        start = {var: cp.Variable(1, name=f"{names[var]}_now") for var in self.table.coupling}
        self._now = {var: cp.Parameter(name=f"{names[var]}_given") for var in start}
        self._x: dict[Entry, Any] = {Entry(var, False): x[var] for var in x}
        for state, known in start.items():
            self._x[Entry(state, True)] = cp.hstack([UNIT[state] * known, x[state][:-1]])
        self._given: dict[str, Any] = {}
        self.rows = {row.name: self._constraints(row) for row in self.table.rows}
        self.constraints = [self._x[Entry(s, True)][0] == now for s, now in self._now.items()]
        self.constraints += [part for parts in self.rows.values() for part in parts]
        of = x if regularised else ()
        self._smoothing = {var: cp.Parameter(stages, nonneg=True) for var in of}
        self.objective = cp.Minimize(self._cost())
        self.problem = cp.Problem(self.objective, self.constraints)

    def add(self, cost_g: Any, constraints: Sequence[Any]) -> None:
        """Add a convex cost in grams and constraints to the program."""
        self.objective = cp.Minimize(self.objective.expr + cost_g)
        self.constraints = [*self.constraints, *constraints]
        self.problem = cp.Problem(self.objective, self.constraints)

    def given(self, name: str) -> Any:
        """Return what the program knows of each stage, shape (n,), by a name of its table.

        Such as `duration_s`, `net_w`, `speed_mps`: fields of `Stages`, `QUANTITIES` of
        `qpmpc.qp.rows`, numbers of `qp_parameters`. What changes is a parameter, set each second;
        cvxpy knows that durations, speeds, shares and rises are not negative.

        Raises
        ------
        InputError
            If the table has no such name.
        """
        if name not in self._given:
            known = self._quantities.of_stages()
            if name not in known:
                raise InputError(unknown("quantity of a stage", name, tuple(sorted(known))))
            self._given[name] = self._value(expression(name), name=name)
        return self._given[name]

    def state(self, name: str) -> State:
        """Add a state of your own: a variable of each stage, and its value now as a parameter.

        Parameters
        ----------
        name : of the variables, letters, digits and underscores
        """
        if not name.isidentifier():
            raise InputError(f"a state's name has letters, digits and underscores, not {name!r}")
        end, first = cp.Variable(self.stages, name=name), cp.Variable(1, name=f"{name}_now")
        now = cp.Parameter(name=f"{name}_given")
        self.constraints = [*self.constraints, first[0] == now]
        return State(end, cp.hstack([first, end[:-1]]), now)

    def __getattr__(self, name: str) -> Any:
        """Say what there is instead of a name that is wrong."""
        if name.startswith("_"):
            raise AttributeError(name)
        known = [each for each in vars(self) if not each.startswith("_")]
        raise AttributeError(unknown("name of the program", name, (*known, *METHODS)))

    def _value(self, formula: ast.expr, piece: int = 0, name: str = "") -> Any:
        """A formula of the table, for one piece of its row: a parameter where steps change it."""
        code = code_of(formula)
        if self._quantities.is_changing(formula):
            # its name is also that of a function in generated C
            own = name or f"given_{len(self._parameters)}"
            parameter = cp.Parameter(self.stages, name=own, nonneg=name in NONNEGATIVE)
            self._parameters.append((parameter, code, piece))
            return parameter
        return self._of_piece(code, piece)

    def _of_piece(self, code: CodeType, piece: int) -> Floats:
        found = np.atleast_2d(self._quantities.value(code))
        column = piece if found.shape[1] > 1 else 0
        return np.broadcast_to(found[:, column], (self.stages,))

    def _constraints(self, row: Row) -> list[Any]:
        """One row of every stage, for each piece of its curve."""
        count = {"": 1, "fuel": self.model.fuel.pieces, "battery": self.model.battery.pieces}
        found: list[Any] = []
        for i in range(count[row.pieces]):
            terms = row.terms.items()
            left = sum(cp.multiply(self._value(part, i), self._x[entry]) for entry, part in terms)
            if row.is_equality and row.low is not None:
                found.append(left == self._value(row.low, i))
                continue
            found += [] if row.low is None else [left >= self._value(row.low, i)]
            found += [] if row.high is None else [left <= self._value(row.high, i)]
        return found

    def _cost(self) -> Any:
        """Cost of all stages, with the small quadratic terms that are set."""
        cost: Any = 0.0
        for entry, weight in self.table.cost.items():
            cost += cp.sum(cp.multiply(self._value(weight), self._x[entry]))
        for var, weights in self._smoothing.items():
            cost += 0.5 * cp.sum_squares(cp.multiply(weights, self.variables[var]))
        if self.settings.soc_penalty_g:
            gap = self.soc[-1] - self.vehicle.trip.soc_target
            cost += self.settings.soc_penalty_g * cp.square(gap)
        return cost

    def update(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        engine_on: bool = False,
        scaling: Scaling | None = None,
    ) -> None:
        """Set the parameters for a horizon, a state and a linearisation point.

        Parameters
        ----------
        stages : the trip ahead, n stages
        soc, t_cl_degc : state at the start of the horizon
        about : linearisation point
        engine_on : whether the engine runs now; read where starts cost something
        scaling : the regularisation of `StageQp` is defined in its solver units; with its scaling
            it is the same here, without it is zero
        """
        state = {Var.SOC: soc, Var.T_CL: t_cl_degc, Var.ON: 0.0}  # on: in the bound
        for var, now in self._now.items():
            now.value = state[var]
        self._quantities.update(stages, soc, about, engine_on)
        for parameter, code, piece in self._parameters:
            parameter.value = self._of_piece(code, piece)
        self._smooth(scaling)

    def _smooth(self, scaling: Scaling | None) -> None:
        if scaling is not None and not self._smoothing:
            raise QpmpcError("cvxpy twin: a scaling has no effect without regularised=True")
        weights = np.zeros((self.stages, len(self.table.variables)))
        if scaling is not None:
            # 1/2 r z^2 of cost c x grams, with z = x / column
            size = self.settings.regularisation / scaling.cost
            weights = np.sqrt(size) / scaling.column.reshape(weights.shape)
            weights[:, self.table.states] = 0.0
        for var in self._smoothing:
            self._smoothing[var].value = weights[:, var] * UNIT[var]

    def solve(self, solver: str = "CLARABEL", **options: Any) -> Floats:
        """Solve for the parameters of the last update.

        Parameters
        ----------
        solver, options : passed on to cvxpy

        Returns
        -------
        x, shape (n, variables), SI units, columns as in `Var`

        Raises
        ------
        QpmpcError
            If the solver finds no optimum.
        """
        try:
            self.problem.solve(solver=solver, **options)
        except cp.SolverError as error:
            reason = " ".join(str(error).split())
            raise QpmpcError(f"cvxpy twin: {solver}: {reason}") from error
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            raise QpmpcError(f"cvxpy twin: {solver} ends with {self.problem.status!r}")
        return self.plan()

    def is_solvable_without(self, constraints: Sequence[Any], solver: str) -> bool:
        """Whether the program of the last update has an optimum without some constraints."""
        left = [each for each in self.constraints if not any(each is one for one in constraints)]
        problem = cp.Problem(self.objective, left)
        try:
            problem.solve(solver=solver)
        except cp.SolverError:
            return False
        return problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)

    def plan(self) -> Floats:
        """Return x as solved, see `solve`."""
        return np.column_stack(
            [np.asarray(self._x[Entry(var, False)].value) for var in self.table.variables]
        )
