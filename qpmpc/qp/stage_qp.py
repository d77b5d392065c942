"""The multi-horizon QP: values of all its entries, updated in place of being rebuilt."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.coolant import coolant_row
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.structure import VARS, QpStructure, Rows, Var
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]
Weight = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]

SHORTEST_SCALE_S = 1.0  # a masked stage is scaled as one of 1 s
T_CL_MAX_MARGIN_K = 0.05  # small: the radiator is fully open only at the limit itself
REACH_MARGIN_SOC = 1e-5
ACCURATE_STAGE_S = 1.0  # a stage of this length or less is known, a longer one is forecast
SIGMA_FORCED = 0.99  # "engine must be on" as a lower bound on sigma, kept apart from the upper one
LEAST_COST = 1e-9  # of any fuel entry: where all stages are masked the cost is scaled by this


class QpSettings(BaseModel):
    """Weights and margins of the QP.

    Attributes
    ----------
    terminal_low, terminal_high : terminal SOC band as multiples of the initial SOC (paper eq. 11)
    soc_penalty_g : lambda of a quadratic terminal cost, g per (unit SOC)^2, instead of the band
    soc_reserve : share of the room between the lower SOC limit and the initial SOC that stages of
        more than 1 s are planned to leave, for what the forecast does not foretell
    t_cl_margin_k : the coolant is planned to stay this far above its lower limit
    slack_g_per_k : price of a coolant limit exceeded, g per K and stage
    regularisation : quadratic cost on rates and slack in solver units, far below any fuel
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    terminal_low: Annotated[float, Field(gt=0.0, le=1.5)] = 1.0
    terminal_high: Annotated[float, Field(gt=0.0, le=1.5)] = 1.01
    soc_penalty_g: Annotated[float, Field(ge=0.0)] = 0.0
    soc_reserve: Annotated[float, Field(ge=0.0, le=0.9)] = 0.42
    t_cl_margin_k: Annotated[float, Field(ge=0.0, le=10.0)] = 0.5
    slack_g_per_k: Weight = 10.0
    regularisation: Annotated[float, Field(ge=0.0, le=1.0)] = 1e-5


@dataclass(frozen=True)
class QpData:
    """min 1/2 x^T P x + q^T x  s.t.  lower <= A x <= upper, in solver units.

    `hessian` is the diagonal of P; `a_data` the values of A in CSC order.
    """

    hessian: Floats
    q: Floats
    a_data: Floats
    lower: Floats
    upper: Floats
    scaling: Scaling


class StageQp:
    """QP of one trip: structure once, values each step.

    min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + slack  over the rows of `Rows`

    with T_k the mean coolant temperature of the stage; the source is the paper's problem
    (eqs. 9-11) after the perspective relaxation of the on/off choice.

    Parameters
    ----------
    vehicle, model : plant parameters and the PWA curves made from them
    stages : number of stages n
    settings, scaling : weights and units
    """

    def __init__(
        self,
        vehicle: Vehicle,
        model: PwaModel,
        stages: int,
        settings: QpSettings,
        scaling: ScalingSettings,
    ) -> None:
        self.vehicle, self.model, self.settings, self.units = vehicle, model, settings, scaling
        self.rows = Rows(model.fuel.pieces, model.battery.pieces)
        self.structure = QpStructure(stages, self.rows)
        self.stages = stages
        battery_rows = range(self.rows.battery.start, self.rows.battery.stop)
        self._battery_on = [self.structure.index[row, Var.ON, False] for row in battery_rows]
        self._values = self._constant_entries()
        self._lower, self._upper = self._constant_bounds()
        self._hessian = np.full((stages, VARS), settings.regularisation)
        self._hessian[:, [Var.SOC, Var.T_CL]] = 0.0
        self._unit = np.empty(VARS)
        self._unit[Var.SOC] = scaling.energy_j / model.battery_energy_j
        self._unit[[Var.T_CL, Var.T_SLACK]] = scaling.t_cl_k
        self._unit[[Var.P_ENG, Var.INTERNAL]] = scaling.power_w
        self._unit[[Var.ON, Var.FUEL]] = 1.0, scaling.fuel_g_per_s
        self._is_rate = np.isin(np.arange(VARS), [Var.P_ENG, Var.ON, Var.FUEL, Var.INTERNAL])

    def update(self, stages: Stages, soc: float, t_cl_degc: float, about: Linearisation) -> QpData:
        """Compute all values for a horizon, a state and a linearisation point.

        Parameters
        ----------
        stages : the road ahead, n stages
        soc, t_cl_degc : state at the start of the horizon
        about : linearisation point

        Returns
        -------
        `QpData` in solver units, with the `Scaling` that leads back
        """
        self._fill_battery(stages, soc)
        self._fill_engine(stages)
        weights = self._fill_coolant(stages, t_cl_degc, about)
        cost = np.zeros((self.stages, VARS))
        cost[:, Var.FUEL], t_cl_weight = weights
        cost[:, Var.T_CL] = t_cl_weight
        cost[:-1, Var.T_CL] += t_cl_weight[1:]
        cost[:, Var.T_SLACK] = self.settings.slack_g_per_k
        return self._scaled(stages.duration_s, cost)

    def _constant_entries(self) -> Floats:
        """Entries of A that no step changes; the others are 1 until they are filled in."""
        index, rows, model = self.structure.index, self.rows, self.model
        values = np.ones((self.stages, len(index)))
        values[:, index[rows.soc, Var.SOC, True]] = -1.0
        values[:, index[rows.p_eng_min, Var.ON, False]] = -self.vehicle.engine.power_min_w
        values[:, index[rows.t_cl_max, Var.T_SLACK, False]] = -1.0
        for i, row in enumerate(range(rows.fuel.start, rows.fuel.stop)):
            values[:, index[row, Var.P_ENG, False]] = -model.fuel.slope[i]
            values[:, index[row, Var.ON, False]] = -model.fuel.intercept[i]
        for j, row in enumerate(range(rows.battery.start, rows.battery.stop)):
            values[:, index[row, Var.P_ENG, False]] = model.battery.slope[j]
        return values

    def _constant_bounds(self) -> tuple[Floats, Floats]:
        """Bounds that no step changes; infinite where a row has one side only."""
        rows, battery, thermal = self.rows, self.vehicle.battery, self.vehicle.thermal
        lower = np.full((self.stages, rows.count), -np.inf)
        upper = np.full((self.stages, rows.count), np.inf)
        lower[:, rows.soc] = upper[:, rows.soc] = 0.0
        lower[:, rows.fuel] = 0.0
        upper[:, rows.p_eng_max] = 0.0
        upper[:, rows.box_on] = 1.0
        upper[:, rows.box_soc] = battery.soc_max
        if not self.settings.soc_penalty_g:
            upper[-1, rows.box_soc] = min(
                self._terminal(self.settings.terminal_high), battery.soc_max
            )
        lower[:, rows.t_cl_min] = thermal.t_cl_min_degc + self.settings.t_cl_margin_k
        upper[:, rows.t_cl_max] = thermal.t_cl_max_degc - T_CL_MAX_MARGIN_K
        lower[:, rows.box_slack] = 0.0
        return lower, upper

    @property
    def soc_reserve(self) -> float:
        """Reserve of forecast stages above the lower SOC limit, in SOC."""
        room = self.vehicle.trip.soc_init - self.vehicle.battery.soc_min
        return self.settings.soc_reserve * max(room, 0.0)

    def _terminal(self, multiple: float) -> float:
        return multiple * self.vehicle.trip.soc_init

    def _fill_battery(self, stages: Stages, soc: float) -> None:
        """SOC dynamics, battery pieces in perspective, and SOC limits that can be met."""
        index, rows, battery = self.structure.index, self.rows, self.vehicle.battery
        net, h, energy = stages.net_w, stages.duration_s, self.model.battery_energy_j
        off_w = stages.internal_off_w
        self._values[:, index[rows.soc, Var.INTERNAL, False]] = h / energy
        self._lower[0, rows.soc] = self._upper[0, rows.soc] = soc
        pieces = self.model.battery
        self._values[:, self._battery_on] = -(
            np.multiply.outer(net, pieces.slope) + pieces.intercept - off_w[:, None]
        )
        self._lower[:, rows.battery] = off_w[:, None]
        low = battery.soc_min + np.where(h > ACCURATE_STAGE_S, self.soc_reserve, 0.0)
        if not self.settings.soc_penalty_g:
            low[-1] = max(self._terminal(self.settings.terminal_low), battery.soc_min)
        self._lower[:, rows.box_soc] = np.minimum(low, self._reachable_soc(stages, soc))

    def _reachable_soc(self, stages: Stages, soc: float) -> Floats:
        """Highest SOC at the end of each stage, charging all the way: a limit above it is moot."""
        battery, most_w = self.vehicle.battery, self.vehicle.engine.power_max_w
        strongest = np.maximum(stages.net_w - most_w, -battery.power_charge_max_w)
        internal = self.model.battery(strongest)
        gain = stages.duration_s * internal / self.model.battery_energy_j
        return soc - np.cumsum(gain) - REACH_MARGIN_SOC

    def _fill_engine(self, stages: Stages) -> None:
        """Power limits of the on-share, and stages that the battery alone cannot drive."""
        index, rows, battery = self.structure.index, self.rows, self.vehicle.battery
        engine = self.vehicle.engine
        most = np.minimum(engine.power_max_w, stages.net_w + battery.power_charge_max_w)
        self._values[:, index[rows.p_eng_max, Var.ON, False]] = -most
        missing = stages.net_w - battery.power_discharge_max_w
        self._lower[:, rows.p_eng_min] = np.maximum(missing - engine.power_min_w, 0.0)
        self._lower[:, rows.box_on] = np.where(missing > 0.0, SIGMA_FORCED, 0.0)

    def _fill_coolant(
        self, stages: Stages, t_cl_degc: float, about: Linearisation
    ) -> tuple[Floats, Floats]:
        """Coolant row; returns the cost weights of F and of T at both ends of the stage."""
        index, rows, h = self.structure.index, self.rows, stages.duration_s
        row = coolant_row(self.vehicle, self.model, stages, about)
        share = 1.0 - self.vehicle.thermal.exhaust_share
        rate = row.per_heat_k_per_w * share
        half = 0.5 * row.per_heat_k_per_w * row.w_per_k
        before = half - row.per_start
        burnt = rate * self.vehicle.engine.lhv_j_per_g * row.alpha
        self._values[:, index[rows.t_cl, Var.T_CL, False]] = 1.0 + half
        self._values[:, index[rows.t_cl, Var.T_CL, True]] = before
        self._values[:, index[rows.t_cl, Var.FUEL, False]] = -burnt
        self._values[:, index[rows.t_cl, Var.P_ENG, False]] = rate
        self._lower[:, rows.t_cl] = row.constant_degc
        self._lower[0, rows.t_cl] -= before[0] * t_cl_degc
        self._upper[:, rows.t_cl] = self._lower[:, rows.t_cl]
        return h * row.alpha, 0.5 * h * row.growth_g_per_s_per_k

    def _scaled(self, duration_s: Floats, cost: Floats) -> QpData:
        """Scale to solver units: columns by unit and duration, rows to unit norm, cost to one."""
        structure, units = self.structure, self.units
        stretch = np.maximum(duration_s, SHORTEST_SCALE_S) ** -units.duration_exponent
        column = self._unit * np.where(self._is_rate, stretch[:, None], 1.0)
        before = np.zeros_like(column)  # the first stage has none: its entries do not count
        before[1:] = column[:-1]
        entry_scale = np.where(
            structure.entry_before, before[:, structure.entry_var], column[:, structure.entry_var]
        )
        scaled = self._values * entry_scale
        row = 1.0 / np.sqrt(np.add.reduceat(scaled * scaled, structure.entry_start, axis=1))
        scaled *= row[:, structure.entry_row]
        weighted = cost * column
        scale = 1.0 / max(float(weighted[:, Var.FUEL].max()), LEAST_COST)
        hessian = self._hessian.copy()
        gradient = scale * weighted
        if self.settings.soc_penalty_g:
            curvature = 2.0 * self.settings.soc_penalty_g * scale * column[-1, Var.SOC]
            hessian[-1, Var.SOC] = curvature * column[-1, Var.SOC]
            gradient[-1, Var.SOC] -= curvature * self.vehicle.trip.soc_init
        return QpData(
            hessian=hessian.ravel(),
            q=gradient.ravel(),
            a_data=structure.data(scaled),
            lower=(self._lower * row).ravel(),
            upper=(self._upper * row).ravel(),
            scaling=Scaling(column.ravel(), row.ravel(), scale),
        )
