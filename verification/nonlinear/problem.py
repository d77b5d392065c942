"""The multi-horizon problem as a nonlinear program: exact maps, no linearisation, no pieces."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.qp.coolant_floor import CoolantFloor
from qpmpc.qp.heat_reserve import heat_reserve_k
from qpmpc.qp.rows import COOL_SHARE, SHORTEST_SCALE_S, SIGMA_FORCED, SOC_KEPT, Var, table_of
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import T_CL_MAX_MARGIN_K
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.heat import air_w
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import EMPTY, FULL
from qpmpc.verification.nonlinear.maps import SmoothMaps, casadi

Floats = NDArray[np.float64]


class NlpVar(IntEnum):
    """Variables of a stage, in solver units (`UNIT` has the size of one in SI).

    Those of the QP, in its places; fuel and internal power are maps here, and slack follows.
    """

    SOC = Var.SOC
    T_CL = Var.T_CL
    ABOVE = Var.P_ENG  # D, mean engine power above the least running power, W
    ON = Var.ON
    T_SLACK = Var.ON + 1
    START = Var.ON + 2  # only where a start costs something


UNIT = np.array([0.01, 1.0, 10e3, 1.0, 1.0, 1.0])

SOC_GAIN_ROW = 0  # of the rows of a stage, the change of SOC
SOC_ROW = 2  # of the rows of a stage, the limit that may have to give way
T_CL_ROW = 3  # the lower limit of the coolant, which the trip ahead may raise
SIGMA_LEAST = 1e-4  # keeps the power of an engine that is off at its best value
SOC_SHORTFALL_G = 5000.0  # price of a unit of SOC missed, over ten times its worth in fuel
WASTE_G = 0.01  # price of 0.01 of SOC thrown away, far below its worth: keeps SOC determined
# g per stage, on squared power, on-share and slack in solver units
REGULARISATION, MASKED_REGULARISATION = 1e-6, 1e-3
THERMOSTAT_STEPS = 8  # of a long stage; measured: 0.2 K in the mean at 200 s, 0.03 K at 90 s
NO_DIVISION_BY_ZERO = 1e-9
ROAD = 8  # h, P0, v, P0 and l of the seconds with a choice, least and most engine power, rises
POWER_GAP_W = 10.0  # least distance of the limits of engine power


@dataclass(frozen=True)
class NlpData:
    """Parameters and bounds of one step's problem; `power_least_w` is of a running engine."""

    power_least_w: Floats
    parameters: Floats
    lower: Floats
    upper: Floats
    row_lower: Floats
    row_upper: Floats


class NlpProblem:
    """The nonlinear program of one trip: built once, parameters and bounds updated each step.

    min  sum_k h_k alpha(T_k) sigma_k f(P_k) + starts + prices of limits exceeded, subject to

    - SOC_k <= SOC_{k-1} - h_k/C_bat [sigma_k I(SOC, P0_k - P_k) + (1 - sigma_k) I_off,k(SOC)]
      (paper eq. 1; smaller where the friction brakes take what a full battery cannot), with
      P0_k the mean of the seconds with the engine on, free_k + (mean_k - free_k) / sigma_k, and
      U I_off = l_k + G(SOC, free_k) - G(SOC_init, free_k); l_k, free_k: means of l(P0) and P0 over
      the seconds in which the engine may be off
    - C dT/dt = (1 - x)(LHV alpha(T) F_k - E_k) - UA(v_k)(T - T_amb) - Q_heat(T) - Q_rad (eq. 3)
      with F = sigma f(P), E = sigma P; Q_rad follows T within the stage
    - u_k >= r_k (sigma_k - sigma_{k-1}), u_k >= 0: starts, whose fuel, heat and cranking count
    - the limits of eqs. (9)-(11), T and SOC without index being the mean over the stage

    The variables are sigma and D with P = P_least + D / sigma: in this perspective form the program
    is convex but for alpha(T) and the voltage, which a product sigma P is not.

    sigma is the share of the stage with the engine on: exact for long stages, whose seconds may
    differ, and a relaxation for those of one second.

    Parameters
    ----------
    vehicle : parameters
    stages : number of stages
    short_stages : how many of them, at the front, are of one second
    settings : terminal band and margins, the same as the QP's

    Attributes
    ----------
    count : variables of a stage
    short_stages : as given
    """

    def __init__(
        self, vehicle: Vehicle, stages: int, short_stages: int, settings: QpSettings
    ) -> None:
        self.vehicle, self.stages, self.settings = vehicle, stages, settings
        self.short_stages = short_stages
        self._maps = SmoothMaps(vehicle)
        self._has_start = table_of(vehicle.engine).has_start
        self.count = len(NlpVar) if self._has_start else len(NlpVar) - 1
        self._build()

    def _build(self) -> None:
        ca, n, trip = casadi(), self.stages, self.vehicle.trip
        short_stages = self.short_stages
        z = ca.MX.sym("z", self.count, n)
        missing = ca.MX.sym("missing")  # of SOC, in solver units
        road = ca.MX.sym("road", ROAD, n)
        state = ca.MX.sym("state", 3)  # SOC, T, whether the engine runs
        x = z * ca.repmat(ca.DM(UNIT[: self.count]), 1, n)
        before = ca.horzcat(state[:2], x[: NlpVar.T_CL + 1, :-1])
        parts = []
        for inside, steps in ((slice(short_stages), 1), (slice(short_stages, n), THERMOSTAT_STEPS)):
            if count := len(range(n)[inside]):
                stage = self.stage(steps).map(count)
                parts.append(stage(before[:, inside], x[:, inside], road[:, inside]))
        fuel_g, soc_gain, t_cl_gap = (ca.horzcat(*part) for part in zip(*parts, strict=True))
        sigma = x[NlpVar.ON, :]
        cost = ca.sum2(fuel_g) + self.settings.slack_g_per_k * ca.sum2(x[NlpVar.T_SLACK, :])
        cost += SOC_SHORTFALL_G * UNIT[NlpVar.SOC] * missing
        cost += WASTE_G * ca.sum2(soc_gain) / UNIT[NlpVar.SOC]
        weight = ca.if_else(road[0, :] > 0.0, REGULARISATION, MASKED_REGULARISATION)
        cost += ca.sum2(weight * ca.sum1(z[NlpVar.ABOVE :, :] ** 2))
        rows_of_start = []
        if self._has_start:
            cost += self.vehicle.engine.start_fuel_g * ca.sum2(x[NlpVar.START, :])
            rise = sigma - ca.horzcat(state[2], sigma[:-1])
            rows_of_start = [x[NlpVar.START, :] - road[7, :] * rise]
        if self.settings.soc_penalty_g:
            cost += self.settings.soc_penalty_g * (x[NlpVar.SOC, -1] - trip.soc_target) ** 2
        rows = ca.vertcat(
            soc_gain / UNIT[NlpVar.SOC],
            t_cl_gap,
            z[NlpVar.SOC, :] + missing,
            x[NlpVar.T_CL, :] + x[NlpVar.T_SLACK, :],
            x[NlpVar.T_CL, :] - x[NlpVar.T_SLACK, :],
            ((road[6, :] - road[5, :]) * sigma - x[NlpVar.ABOVE, :]) / UNIT[NlpVar.ABOVE],
            *rows_of_start,
        )
        self.rows_per_stage = rows.shape[0]
        self.program: dict[str, Any] = {
            "x": ca.vertcat(ca.vec(z), missing),
            "p": ca.vertcat(ca.vec(road), state),
            "f": cost,
            "g": ca.vec(rows),
        }
        self._row_lower, self._row_upper = self._row_bounds()
        energy_j = BatteryMaps(self.vehicle.battery).energy_j(trip.soc_mean)
        least = self.vehicle.thermal.t_cl_min_degc + self.settings.t_cl_margin_k
        least += heat_reserve_k(self.vehicle, self._maps.line)
        self._floor = CoolantFloor(self.vehicle, self._maps.line, energy_j, least)

    def stage(self, thermostat_steps: int) -> Any:
        """CasADi's function of a stage: (SOC and T before, variables, road) -> fuel, SOC, T.

        Fuel in g, without that of starts; what SOC is above the variable, and T of the coolant, K.
        All in SI units; the road's fields are those of `data`.
        """
        ca, maps, vehicle = casadi(), self._maps, self.vehicle
        th = vehicle.thermal
        before, x, road = (
            ca.SX.sym("before", 2),
            ca.SX.sym("x", self.count),
            ca.SX.sym("road", ROAD),
        )
        h, net_w, speed_mps = road[0], road[1], road[2]
        sigma = x[NlpVar.ON]
        power = road[5] + x[NlpVar.ABOVE] / sigma
        soc = 0.5 * (before[0] + x[NlpVar.SOC])
        t_cl = 0.5 * (before[1] + x[NlpVar.T_CL])
        free_w = road[3]
        on_w = free_w + (net_w - free_w) / sigma  # mean of the seconds with the engine on
        most_w = ca.fmin(free_w, vehicle.battery_discharge_max_w)
        off_w = road[4] + maps.internal_w(soc, most_w)
        off_w -= maps.internal_w(vehicle.trip.soc_mean, most_w)
        drawn_w = sigma * maps.internal_w(soc, on_w - power) + (1.0 - sigma) * off_w
        current = drawn_w / maps.voltage_v(soc)
        fuel = maps.alpha(t_cl) * sigma * maps.fuel_g_per_s(power)  # g/s, of the cold engine
        lhv_j_per_g = vehicle.engine.lhv_j_per_g
        heat = (1.0 - th.exhaust_share) * (lhv_j_per_g * fuel - sigma * power)
        heat -= air_w(th, t_cl, speed_mps)
        heat -= maps.cabin_w(t_cl)
        if self._has_start:
            engine, start = vehicle.engine, x[NlpVar.START]
            aux_w = vehicle.battery.aux_power_w
            cranking_w = maps.internal_w(soc, aux_w + engine.start_energy_j)  # for a second
            cranking_w -= maps.internal_w(soc, aux_w)
            cranking = start * cranking_w / maps.voltage_v(soc)
            start_w = lhv_j_per_g * engine.start_fuel_g * start / ca.fmax(h, SHORTEST_SCALE_S)
            heat += (1.0 - th.exhaust_share) * start_w
        else:
            cranking = 0.0
        charge_c = 3600.0 * vehicle.battery.capacity_ah
        soc_gain = before[0] - (h * current + cranking) / charge_c - x[NlpVar.SOC]
        t_cl_gap = self._coolant_after(before[1], h, heat, thermostat_steps) - x[NlpVar.T_CL]
        return ca.Function("stage", [before, x, road], [h * fuel, soc_gain, t_cl_gap])

    def _coolant_after(self, t_cl_degc: Any, h: Any, heat_w: Any, steps: int) -> Any:
        """T after a stage of constant heat in which the thermostat opens or closes.

        C dT/dt = q - Q_rad(T), each of the steps exact for Q_rad linear about its start: stable
        for any length.
        """
        ca, capacity = casadi(), self.vehicle.thermal.heat_capacity_j_per_k
        at = ca.SX.sym("at")
        radiator = self._maps.radiator_w(at)
        radiator_and_slope = ca.Function("radiator", [at], [radiator, ca.gradient(radiator, at)])
        step = h / steps
        for _ in range(steps):
            taken_w, slope = radiator_and_slope(t_cl_degc)
            share = step * slope / capacity + NO_DIVISION_BY_ZERO
            t_cl_degc += -ca.expm1(-share) / share * step * (heat_w - taken_w) / capacity
        return t_cl_degc

    def _row_bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the rows, except the lower limits of SOC and coolant, which change."""
        thermal = self.vehicle.thermal
        shape = self.stages, self.rows_per_stage
        lower, upper = np.full(shape, -np.inf), np.full(shape, np.inf)
        lower[:, [0, 1, *range(5, self.rows_per_stage)]], upper[:, 1] = 0.0, 0.0
        upper[:, 4] = thermal.t_cl_max_degc - T_CL_MAX_MARGIN_K
        return lower, upper

    def data(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        engine_on: bool = False,
        t_cl_plan_degc: Floats | None = None,
    ) -> NlpData:
        """Parameters and bounds for a horizon and a state.

        Parameters
        ----------
        stages : the trip ahead
        soc, t_cl_degc, engine_on : state at its start
        t_cl_plan_degc : coolant at the ends of the stages in the plan of the step before, by which
            blocks are hot; without one that of now, shape (n,)
        """
        vehicle, engine = self.vehicle, self.vehicle.engine
        net = stages.net_w
        lower, upper = np.zeros((self.stages, self.count)), np.zeros((self.stages, self.count))
        most = np.minimum(engine.power_max_w, net + vehicle.battery_charge_max_w)
        least = np.maximum(engine.power_min_w, net - vehicle.battery_discharge_max_w)
        must = stages.must_share
        can = (must > 0.0) | (most > engine.power_min_w)
        least = np.minimum(least, engine.power_max_w - POWER_GAP_W)
        most = np.maximum(most, least + POWER_GAP_W)
        hot_degc = t_cl_degc if t_cl_plan_degc is None else t_cl_plan_degc
        is_hot = hot_degc > self.vehicle.thermal.thermostat_open_degc
        soc_low, soc_high = self._soc_limits(stages, soc, is_hot)
        upper[:, NlpVar.SOC] = soc_high / UNIT[NlpVar.SOC]
        lower[:, NlpVar.T_CL], upper[:, NlpVar.T_CL] = self.vehicle.thermal.t_amb_degc, 120.0
        upper[:, NlpVar.ABOVE] = np.inf
        lower[:, NlpVar.ON] = np.maximum(SIGMA_FORCED * must, SIGMA_LEAST)
        upper[:, NlpVar.ON] = np.where(can, 1.0, 2.0 * SIGMA_LEAST)
        upper[:, NlpVar.T_SLACK :] = np.inf
        free = stages.free_net_w, stages.free_internal_off_w
        fields = stages.duration_s, net, stages.speed_mps, *free
        road = np.stack([*fields, least, most, stages.rises])
        row_lower = self._row_lower.copy()
        row_lower[:, SOC_ROW] = soc_low / UNIT[NlpVar.SOC]
        row_lower[:, T_CL_ROW] = self._floor.at(stages, soc)
        return NlpData(
            power_least_w=least,
            parameters=np.concatenate([road.ravel(order="F"), [soc, t_cl_degc, float(engine_on)]]),
            lower=np.append(lower.ravel(), 0.0),
            upper=np.append(upper.ravel(), np.inf),
            row_lower=row_lower.ravel(),
            row_upper=self._row_upper.ravel(),
        )

    def _soc_limits(
        self, stages: Stages, soc: float, is_hot: bool | NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """Limits of SOC, with the QP's reserve and the swing inside blocks.

        The lower ones are no higher than charging throughout reaches.
        """
        battery, trip, settings = self.vehicle.battery, self.vehicle.trip, self.settings
        maps = BatteryMaps(battery)
        energy_j = maps.energy_j(trip.soc_mean)
        reserve = settings.soc_reserve * max(trip.soc_lower_end - battery.soc_min, 0.0)
        low = np.maximum(battery.soc_min + SOC_KEPT + stages.fall_j / energy_j, EMPTY)
        kept = reserve * np.where(is_hot, 1.0, COOL_SHARE) - stages.refill_j / energy_j
        low += np.where(stages.fall_j > 0.0, np.maximum(kept, 0.0), 0.0)
        high = np.minimum(battery.soc_max - stages.rise_j / energy_j, FULL)
        if not settings.soc_penalty_g:
            low[-1] = max(settings.terminal_low * trip.soc_target, battery.soc_min)
            high[-1] = min(settings.terminal_high * trip.soc_target, battery.soc_max)
            if trip.soc_end_at_least:
                low[-1], high[-1] = trip.soc_target, battery.soc_max
        most_w = self.vehicle.engine.power_max_w
        strongest = np.maximum(stages.net_w - most_w, -self.vehicle.battery_charge_max_w)
        gain = stages.duration_s * maps.internal_power_w(trip.soc_mean, strongest)
        low = np.minimum(low, soc - np.cumsum(gain) / energy_j)
        return low, np.maximum(high, low)
