"""The multi-horizon QP: values of all its entries, updated instead of rebuilt."""

from dataclasses import dataclass
from types import CodeType

import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import InputError
from qpmpc.preview.stages import Stages
from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.expressions import code_of, expression
from qpmpc.qp.heat_reserve import heat_reserve_k
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.polish import Prices
from qpmpc.qp.quantities import Quantities, fuel_chord
from qpmpc.qp.rows import SHORTEST_SCALE_S, VARIABLES, Rows, Var, table_of
from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.structure import QpStructure
from qpmpc.vehicle.must_run import fastest_off_mps
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

REACH_MARGIN_SOC = 1e-5
T_CL_MAX_MARGIN_K = 0.05  # small: the radiator is fully open only at the limit itself
LEAST_COST = 1e-9  # of any fuel entry: where all stages are masked the cost is scaled by this


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


def qp_parameters(
    vehicle: Vehicle, model: PwaModel, settings: QpSettings, units: ScalingSettings
) -> dict[str, float]:
    """Collect the numbers of the QP, by their names in its table.

    Raises
    ------
    InputError
        If the terminal SOC band is empty.
    """
    engine, battery, thermal, trip = vehicle.engine, vehicle.battery, vehicle.thermal, vehicle.trip
    soc_low = max(settings.terminal_low * trip.soc_target, battery.soc_min)
    soc_high = min(settings.terminal_high * trip.soc_target, battery.soc_max)
    if trip.soc_end_at_least:
        soc_low, soc_high = trip.soc_target, battery.soc_max
    if soc_low > soc_high:
        raise InputError(
            f"terminal_low={settings.terminal_low:g} and terminal_high={settings.terminal_high:g} "
            f"times the SOC at arrival, {trip.soc_target:g}, within soc_min={battery.soc_min:g} "
            f"and soc_max={battery.soc_max:g}, leave no terminal SOC: {soc_low:g} is above "
            f"{soc_high:g}"
        )
    crank_j = cranking_j(vehicle, model)
    return {
        "engine_max_w": engine.power_max_w,
        "engine_min_w": engine.power_min_w,
        "lhv_j_per_g": engine.lhv_j_per_g,
        "start_fuel_g": engine.start_fuel_g,
        "cranking_j": crank_j,
        **fuel_chord(model.fuel, engine.power_max_w),
        **{name: float(value) for name, value in thermal.model_dump().items()},
        "battery_energy_j": model.battery_energy_j,
        "battery_discharge_max_w": vehicle.battery_discharge_max_w,
        "battery_charge_max_w": vehicle.battery_charge_max_w,
        "electric_max_mps": fastest_off_mps(vehicle),
        "soc_min": battery.soc_min,
        "soc_max": battery.soc_max,
        "soc_init": trip.soc_init,
        "soc_target": trip.soc_target,
        # of stages of more than 1 s, above soc_min
        "soc_reserve": settings.soc_reserve * max(trip.soc_lower_end - battery.soc_min, 0.0),
        "reach_margin_soc": REACH_MARGIN_SOC + crank_j / model.battery_energy_j,
        "terminal_soc_low": soc_low,
        "terminal_soc_high": soc_high,
        "soc_penalty_g": settings.soc_penalty_g,
        "t_min_degc": thermal.t_cl_min_degc
        + settings.t_cl_margin_k
        + heat_reserve_k(vehicle, model.line),
        "t_max_degc": thermal.t_cl_max_degc - T_CL_MAX_MARGIN_K,
        "slack_g_per_k": settings.slack_g_per_k,
        "regularisation": settings.regularisation,
        "unit_soc": units.unit_soc(model.battery_energy_j),
        "unit_t_k": units.t_cl_k,
        "unit_power_w": units.power_w,
        "unit_fuel_g_per_s": units.fuel_g_per_s,
        "unit_start": units.starts,
    }


def cranking_j(vehicle: Vehicle, model: PwaModel) -> float:
    """Energy that a start takes out of the battery's store.

    l(P_aux + E / 1 s) - l(P_aux) for 1 s, with E the energy that cranks the engine and l the
    fitted curve of internal power: as if the car stood. At the power of driving the loss is
    another, by a tenth of E at most.
    """
    aux_w = vehicle.battery.aux_power_w
    with_start, without = model.battery(np.array([aux_w + vehicle.engine.start_energy_j, aux_w]))
    return float(with_start - without)


class StageQp:
    """QP of one trip: structure once, values each step.

    min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + slack  over the rows of `qpmpc.qp.rows`

    with T_k the mean coolant temperature of the stage; the source is the paper's problem
    (eqs. 9-11) after the perspective relaxation of the on/off choice.

    Parameters
    ----------
    vehicle, model : plant parameters and the PWA curves made from them
    stages : number of stages n
    settings, scaling : weights and units
    learning : whether the fuel curve will be replaced, see `learn`
    """

    def __init__(
        self,
        vehicle: Vehicle,
        model: PwaModel,
        stages: int,
        settings: QpSettings,
        scaling: ScalingSettings,
        learning: bool = False,
    ) -> None:
        self.vehicle, self.model, self.settings, self.units = vehicle, model, settings, scaling
        self.table = table_of(vehicle.engine)
        self.rows = Rows(self.table, fuel=model.fuel.pieces, battery=model.battery.pieces)
        self.structure = QpStructure(stages, self.rows)
        self.stages = stages
        parameters = qp_parameters(vehicle, model, settings, scaling)
        self._quantities = Quantities(parameters, vehicle, model, stages, learning)
        self._values = np.empty((stages, len(self.structure.index)))
        self._lower = np.full((stages, self.rows.count), -np.inf)
        self._upper = np.full((stages, self.rows.count), np.inf)
        self._each_step = self._fill_constants()
        self._before = [
            (self.rows[row.name], self.structure.places(row, entry), entry.var)
            for row in self.table.rows
            for entry in row.terms
            if entry.before
        ]
        self._cost = np.zeros((stages, len(self.table.variables)))
        self._dynamics = [
            (
                self.rows.first(row.name),
                {e.var: self.structure.places(row, e).start for e in row.terms if not e.before},
            )
            for row in self.table.rows
            if row.is_equality
        ]
        self._weights = [(entry, code_of(factor)) for entry, factor in self.table.cost.items()]
        variables = self.table.variables
        self._hessian = np.full((stages, len(variables)), settings.regularisation)
        self._hessian[:, self.table.states] = 0.0
        units = [expression(VARIABLES[var].unit) for var in variables]
        self._unit = np.array([self._quantities.value(code_of(unit)) for unit in units])
        self._is_rate = np.array([VARIABLES[var].is_rate for var in variables])

    def _fill_constants(self) -> list[tuple[Floats, CodeType]]:
        """Fill in the constant entries; return the places and formulas of the others."""
        structure, each_step = self.structure, []
        for row in self.table.rows:
            place = self.rows[row.name]
            for entry, factor in row.terms.items():
                values = self._values[:, structure.places(row, entry)]
                if self._quantities.is_changing(factor):
                    each_step.append((values, code_of(factor)))
                else:
                    values[:] = self._quantities.value(code_of(factor))
            for bounds, bound in ((self._lower, row.low), (self._upper, row.high)):
                if bound is not None and (row.before or self._quantities.is_changing(bound)):
                    each_step.append((bounds[:, place], code_of(bound)))
                elif bound is not None:
                    bounds[:, place] = self._quantities.value(code_of(bound))
        return each_step

    def update(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        engine_on: bool = False,
    ) -> QpData:
        """Compute all values for a horizon, a state and a linearisation point.

        Parameters
        ----------
        stages : the trip ahead, n stages
        soc, t_cl_degc : state at the start of the horizon
        about : linearisation point
        engine_on : whether the engine runs now; read where starts cost something

        Returns
        -------
        `QpData` in solver units, with the `Scaling` that leads back
        """
        value = self._quantities.value
        self._quantities.update(stages, soc, about, engine_on)
        for place, formula in self._each_step:
            place[:] = value(formula)
        self._start_at({Var.SOC: soc, Var.T_CL: t_cl_degc, Var.ON: 0.0})  # on: in the bound
        cost = self._cost = np.zeros((self.stages, len(self.table.variables)))
        for entry, weight in self._weights:
            if entry.before:
                cost[:-1, [entry.var]] += np.broadcast_to(value(weight), (self.stages, 1))[1:]
            else:
                cost[:, [entry.var]] += value(weight)
        return self._scaled(stages.duration_s, cost)

    def learn(self, fuel: PwaFit) -> None:
        """Use another fuel curve, of as many pieces, from the next update on."""
        self._quantities.learn(fuel, self.vehicle.engine.power_max_w)

    def prices(self, duals: Floats) -> Prices:
        """Return what the rates of the first second cost at the last update's values.

        Parameters
        ----------
        duals : of all rows, g of fuel per SI unit, shape (n, rows)
        """
        found = []
        for var in (Var.FUEL, Var.P_ENG, Var.INTERNAL):
            price = self._cost[0, var]
            for place, terms in self._dynamics:
                if var in terms:
                    price += duals[0, place] * self._values[0, terms[var]]
            found.append(float(price))
        return Prices(*found)

    def _start_at(self, state: dict[Var, float]) -> None:
        """Put the state now, which is not a variable, into the bounds of the first stage."""
        for rows, entries, var in self._before:
            known = self._values[0, entries] * state[var]
            self._lower[0, rows] -= known
            self._upper[0, rows] -= known

    def _scaled(self, duration_s: Floats, cost: Floats) -> QpData:
        """Scale to solver units: columns by unit and duration, rows to unit norm, cost to one."""
        structure, units = self.structure, self.units
        stretch = np.maximum(duration_s, SHORTEST_SCALE_S) ** -units.duration_exponent
        column = self._unit * np.where(self._is_rate, stretch[:, None], 1.0)
        before = np.zeros_like(column)  # the first stage's own are not used
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
            gradient[-1, Var.SOC] -= curvature * self.vehicle.trip.soc_target
        return QpData(
            hessian=hessian.ravel(),
            q=gradient.ravel(),
            a_data=structure.data(scaled),
            lower=(self._lower * row).ravel(),
            upper=(self._upper * row).ravel(),
            scaling=Scaling(column.ravel(), row.ravel(), scale),
        )
