"""The QP written in cvxpy, straight from its equations: to read, to change, to prototype with."""

from collections.abc import Sequence
from typing import Any

import cvxpy
import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import QpmpcError
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.quantities import Quantities
from qpmpc.qp.rows import SIGMA_FORCED, VARS, Var
from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.stage_qp import T_CL_MAX_MARGIN_K, QpSettings, qp_parameters
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

cp: Any = cvxpy  # its type hints leave out half of its functions

# SI units that one unit of cvxpy's variables stands for, so that solvers see numbers of order one
UNIT = {
    Var.SOC: 0.01,
    Var.T_CL: 1.0,
    Var.P_ENG: 10e3,
    Var.ON: 1.0,
    Var.FUEL: 1.0,
    Var.INTERNAL: 10e3,
    Var.T_SLACK: 1.0,
}


class CvxpyTwin:
    """The multi-horizon QP as a disciplined parametrised program: compiled once, then updated.

    min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + slack

    over the same variables and rows as `StageQp`, in SI units. Its attributes are cvxpy
    expressions: build a changed `cvxpy.Problem` from `objective` and `constraints` to try an
    idea out. Between two updates only parameters change.

    Parameters
    ----------
    vehicle, model : plant parameters and the PWA curves made from them
    stages : number of stages n
    settings : weights and margins

    Attributes
    ----------
    soc, t_cl_degc, p_eng_w, on, fuel_g_per_s, internal_w, t_slack_k : expressions, shape (n,)
    objective, constraints, problem : the program
    """

    def __init__(
        self, vehicle: Vehicle, model: PwaModel, stages: int, settings: QpSettings | None = None
    ) -> None:
        self.vehicle, self.model, self.stages = vehicle, model, stages
        self.settings = settings or QpSettings()
        parameters = qp_parameters(vehicle, model, self.settings, ScalingSettings())
        self._quantities = Quantities(parameters, vehicle.thermal, model, stages)
        self.variables = {var: cp.Variable(stages, name=var.name.lower()) for var in Var}
        self.start = {
            Var.SOC: cp.Variable(1, name="soc_now"),
            Var.T_CL: cp.Variable(1, name="t_cl_now"),
        }
        x = {var: UNIT[var] * variable for var, variable in self.variables.items()}
        self.soc, self.t_cl_degc = x[Var.SOC], x[Var.T_CL]
        self.p_eng_w, self.on = x[Var.P_ENG], x[Var.ON]
        self.fuel_g_per_s, self.internal_w = x[Var.FUEL], x[Var.INTERNAL]
        self.t_slack_k = x[Var.T_SLACK]
        self._declare_parameters()
        self._x = x
        # the state now is a variable with one value, as products of parameters are not DPP
        self.constraints = [
            self._before(Var.SOC)[0] == self._soc_now,
            self._before(Var.T_CL)[0] == self._t_cl_now,
            *self._battery(),
            *self._engine(),
            *self._coolant(),
        ]
        self.objective = cp.Minimize(self._cost())
        self.problem = cp.Problem(self.objective, self.constraints)

    def add(self, cost_g: Any, constraints: Sequence[Any]) -> None:
        """Add a convex cost in grams and constraints to the program."""
        self.objective = cp.Minimize(self.objective.expr + cost_g)
        self.constraints = [*self.constraints, *constraints]
        self.problem = cp.Problem(self.objective, self.constraints)

    def _declare_parameters(self) -> None:
        """One parameter a stage of everything that steps change; products are parameters too."""
        n = self.stages

        def each(name: str, **kind: bool) -> Any:
            return cp.Parameter(n, name=name, **kind)

        self._soc_now, self._t_cl_now = cp.Parameter(name="soc_now"), cp.Parameter(name="t_cl_now")
        self._h = each("h", nonneg=True)
        self._net_w, self._off_w = each("net_w"), each("off_w")
        self._most_w, self._missing_w = each("most_w"), each("missing_w", nonneg=True)
        self._on_least = each("on_least", nonneg=True)
        self._soc_low, self._soc_high = each("soc_low"), each("soc_high")
        self._h_alpha = each("h_alpha", nonneg=True)  # h alpha(T^)
        self._h_growth = each("h_growth")  # h alpha'(T^) F^
        # the coolant's row, see `qpmpc.qp.rows`
        self._per_start = each("per_start", nonneg=True)
        self._per_heat = each("per_heat", nonneg=True)
        self._per_fuel = each("per_fuel", nonneg=True)  # per_heat alpha(T^)
        self._per_mean = each("per_mean")  # per_heat w_per_k
        self._constant_degc = each("constant_degc")
        self._smoothing = {var: each(f"smoothing_{var.name}", nonneg=True) for var in Var}

    def _before(self, var: Var) -> Any:
        """A state at the beginning of each stage."""
        return cp.hstack([UNIT[var] * self.start[var], self._x[var][:-1]])

    def _battery(self) -> list[Any]:
        """SOC from internal power, internal power above every piece of the loss curve."""
        used = cp.multiply(self._h, self.internal_w) / self.model.battery_energy_j
        constraints = [self.soc == self._before(Var.SOC) - used]
        on_w = cp.multiply(self._net_w, self.on) - self.p_eng_w  # sigma P0 - E
        off_w = self._off_w - cp.multiply(self._off_w, self.on)  # (1 - sigma) l(P0)
        pieces = zip(self.model.battery.slope, self.model.battery.intercept, strict=True)
        constraints += [self.internal_w >= c * on_w + d * self.on + off_w for c, d in pieces]
        return [*constraints, self.soc >= self._soc_low, self.soc <= self._soc_high]

    def _engine(self) -> list[Any]:
        """Fuel above every piece of the on-curve, power within its limits while on."""
        pieces = zip(self.model.fuel.slope, self.model.fuel.intercept, strict=True)
        least_w = self.vehicle.engine.power_min_w
        return [
            *(self.fuel_g_per_s >= a * self.p_eng_w + b * self.on for a, b in pieces),
            self.p_eng_w <= cp.multiply(self._most_w, self.on),
            self.p_eng_w >= least_w * self.on + self._missing_w,
            self.on >= self._on_least,
            self.on <= 1.0,
        ]

    def _coolant(self) -> list[Any]:
        """Heat balance with its thermostat, expanded (`qpmpc.qp.rows`), and soft limits."""
        th, settings = self.vehicle.thermal, self.settings
        lhv_j_per_g, share = self.vehicle.engine.lhv_j_per_g, 1.0 - th.exhaust_share
        before = self._before(Var.T_CL)
        mean = 0.5 * (before + self.t_cl_degc)
        burnt = lhv_j_per_g * cp.multiply(self._per_fuel, self.fuel_g_per_s)
        driven = cp.multiply(self._per_heat, self.p_eng_w)
        heated = share * (burnt - driven) - cp.multiply(self._per_mean, mean)
        kept = cp.multiply(self._per_start, before)
        return [
            self.t_cl_degc == kept + heated + self._constant_degc,
            self.t_cl_degc + self.t_slack_k >= th.t_cl_min_degc + settings.t_cl_margin_k,
            self.t_cl_degc - self.t_slack_k <= th.t_cl_max_degc - T_CL_MAX_MARGIN_K,
            self.t_slack_k >= 0.0,
        ]

    def _cost(self) -> Any:
        """Fuel as expanded, price of slack, and what small quadratic terms are asked for."""
        mean = 0.5 * (self._before(Var.T_CL) + self.t_cl_degc)
        cost = cp.sum(cp.multiply(self._h_alpha, self.fuel_g_per_s))
        cost += cp.sum(cp.multiply(self._h_growth, mean))
        cost += self.settings.slack_g_per_k * cp.sum(self.t_slack_k)
        for var, weight in self._smoothing.items():
            cost += 0.5 * cp.sum_squares(cp.multiply(weight, self.variables[var]))
        if self.settings.soc_penalty_g:
            gap = self.soc[-1] - self.vehicle.trip.soc_init
            cost += self.settings.soc_penalty_g * cp.square(gap)
        return cost

    def update(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        scaling: Scaling | None = None,
    ) -> None:
        """Set the parameters for a horizon, a state and a linearisation point.

        Parameters
        ----------
        stages : the road ahead, n stages
        soc, t_cl_degc : state at the start of the horizon
        about : linearisation point
        scaling : the regularisation of `StageQp` is defined in its solver units; with its scaling
            it is the same here, without there is none
        """
        self._soc_now.value, self._t_cl_now.value = soc, t_cl_degc
        found = self._quantities.update(stages, soc, about)

        def stagewise(name: str) -> Floats:
            return np.asarray(found[name])[:, 0]

        h, missing_w = stages.duration_s, stagewise("missing_w")
        self._h.value, self._net_w.value, self._off_w.value = h, stages.net_w, stages.internal_off_w
        self._most_w.value = stagewise("most_w")
        self._missing_w.value = np.maximum(missing_w - self.vehicle.engine.power_min_w, 0.0)
        self._on_least.value = np.where(missing_w > 0.0, SIGMA_FORCED, 0.0)
        self._soc_low.value, self._soc_high.value = stagewise("soc_low"), stagewise("soc_high")
        self._h_alpha.value = h * stagewise("alpha")
        self._h_growth.value = h * stagewise("growth")
        self._per_start.value, self._per_heat.value = stagewise("per_start"), stagewise("per_heat")
        self._per_fuel.value = self._per_heat.value * stagewise("alpha")
        self._per_mean.value = self._per_heat.value * stagewise("w_per_k")
        self._constant_degc.value = stagewise("settled_k")
        self._smooth(scaling)

    def _smooth(self, scaling: Scaling | None) -> None:
        weights = np.zeros((self.stages, VARS))
        if scaling is not None:
            # 1/2 r z^2 of cost c x grams, with z = x / column
            size = self.settings.regularisation / scaling.cost
            weights = np.sqrt(size) / scaling.column.reshape(-1, VARS)
            weights[:, [Var.SOC, Var.T_CL]] = 0.0
        for var in Var:
            self._smoothing[var].value = weights[:, var] * UNIT[var]

    def solve(self, solver: str = "CLARABEL", **options: Any) -> Floats:
        """Solve for the parameters of the last update.

        Parameters
        ----------
        solver, options : passed on to cvxpy

        Returns
        -------
        x, shape (n, VARS), SI units, columns as in `Var`

        Raises
        ------
        QpmpcError
            If the solver finds no optimum.
        """
        try:
            self.problem.solve(solver=solver, **options)
        except cp.SolverError as error:
            raise QpmpcError(f"cvxpy twin: {solver}: {error}") from error
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            raise QpmpcError(f"cvxpy twin: {solver} ends with {self.problem.status!r}")
        return np.column_stack([np.asarray(self._x[var].value) for var in Var])
