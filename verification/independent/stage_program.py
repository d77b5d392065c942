"""The multi-horizon problem written a second time: stages and QP, from equations, in SI units.

Plain loops, stage by stage, without `qpmpc.qp` or `qpmpc.preview`: their results must agree with
this.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from qpmpc.controllers.settings import MhQpSettings
from qpmpc.cycles import Cycle
from qpmpc.pwa.fit import PwaFit
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.independent.equations import Equations

Floats = NDArray[np.float64]

# variables of a stage, in the product's order
SOC, T_CL, P_ENG, ON, FUEL, INTERNAL, T_SLACK = range(7)
COUNT = 7


@dataclass(frozen=True)
class Horizon:
    """Duration (s), P0 (W), mean speed (m/s) and mean l(P0) (W) of each stage; shape (n,)."""

    h: Floats
    net_w: Floats
    speed_mps: Floats
    off_w: Floats


def horizon(cycle: Cycle, vehicle: Vehicle, settings: MhQpSettings, step: int) -> Horizon:
    """Stages at one time step, from the cycle, for an exact forecast.

    The next N seconds one by one; then the rest of each block after those, split into hard, easy
    and braking seconds.
    """
    grid, equations = settings.horizon, Equations(vehicle)
    demand, net = equations.demand_w(cycle), equations.net_w(cycle)
    speed = 0.5 * (cycle.speed_mps[:-1] + cycle.speed_mps[1:])
    give = np.minimum(net, vehicle.battery.power_discharge_max_w)
    off = equations.internal_w(vehicle.trip.soc_init, give)
    steps = cycle.steps
    n, length = grid.short_stages, -(-steps // grid.blocks)
    rows: list[list[float]] = []
    for t in range(step, step + n):
        rows.append([1.0, net[t], speed[t], off[t]] if t < steps else [0.0] * 4)
    for block in range(grid.blocks):
        seconds = range(max(block * length, step + n), min((block + 1) * length, steps))
        classes: list[list[int]] = [[], [], []]
        for t in seconds:
            hard, braking = demand[t] > grid.class_hard_w, demand[t] < grid.class_braking_w
            classes[0 if hard else 2 if braking else 1].append(t)
        for member in classes:
            means = [float(np.mean(a[member])) for a in (net, speed, off)] if member else [0.0] * 3
            rows.append([float(len(member)), *means])
    return Horizon(*np.array(rows).T)


class Expansion(NamedTuple):
    """Point of expansion: T^ of alpha, F^, E^, T at both ends of the stage; shape (n,) each."""

    t_cl_degc: Floats
    fuel_g_per_s: Floats
    p_eng_w: Floats
    begin_degc: Floats
    end_degc: Floats


def expansion(previous: Floats, settings: MhQpSettings, t_cl_degc: float) -> Expansion:
    """Expand about the previous step's solution.

    A short stage takes the solution of the stage that was one second later; the last short one
    and the long ones keep theirs. alpha is taken at the mean of a stage's own ends, in a block of
    demand classes at the mean of the block's.

    Parameters
    ----------
    previous : solution of the step before, SI units, shape (stages, 7)
    t_cl_degc : measured
    """
    moved = shifted(previous, settings)
    ends = np.clip(moved[:, T_CL], 0.0, 100.0)
    begins = np.concatenate([[t_cl_degc], ends[:-1]])
    middle = 0.5 * (begins + ends)
    grid = settings.horizon
    for first in range(grid.short_stages, len(ends), grid.classes):
        last = first + grid.classes - 1
        middle[first : last + 1] = 0.5 * (begins[first] + ends[last])
    fuel, power = np.maximum(moved[:, FUEL], 0.0), np.maximum(moved[:, P_ENG], 0.0)
    return Expansion(middle, fuel, power, begins, ends)


def shifted(values: Floats, settings: MhQpSettings) -> Floats:
    """Stage values of the previous step, moved to the stages of the same seconds."""
    n = settings.horizon.short_stages
    return np.concatenate([values[1:n], values[n - 1 : n], values[n:]])


@dataclass(frozen=True)
class StageProgram:
    """min cost x  s.t.  equal x = equal_to, upper x <= upper_to, in SI units and grams.

    `names` names each inequality.
    """

    cost: Floats
    equal: Floats
    equal_to: Floats
    upper: Floats
    upper_to: Floats
    names: list[str]

    def least(self) -> float:
        """Least cost, by HiGHS."""
        result = linprog(
            self.cost,
            A_ub=self.upper,
            b_ub=self.upper_to,
            A_eq=self.equal,
            b_eq=self.equal_to,
            bounds=(None, None),
            method="highs",
        )
        return float(result.fun) if result.status == 0 else float("nan")

    def violation(self, x: Floats) -> tuple[float, str]:
        """Largest violation, each row counted in units of its largest term, and its name."""
        terms = np.abs(self.upper * x).max(axis=1) + np.abs(self.upper_to) + 1.0
        over = (self.upper @ x - self.upper_to) / terms
        size = np.abs(self.equal * x).max(axis=1) + np.abs(self.equal_to) + 1e-9
        off = np.abs(self.equal @ x - self.equal_to) / size
        if off.size and off.max() > over.max():
            return float(off.max()), "dynamics"
        return float(over.max()), self.names[int(np.argmax(over))]


class _Rows:
    """Collects rows a x <= b with at most a few entries."""

    def __init__(self, variables: int) -> None:
        self._variables = variables
        self.a: list[Floats] = []
        self.b: list[float] = []
        self.names: list[str] = []

    def add(self, name: str, at_most: float, terms: dict[int, float]) -> None:
        row = np.zeros(self._variables)
        for column, value in terms.items():
            row[column] += value
        self.a.append(row)
        self.b.append(at_most)
        self.names.append(name)


@dataclass(frozen=True)
class Curves:
    """Fitted curves of the problem."""

    fuel: PwaFit
    battery: PwaFit
    alpha: PwaFit


def _heat_reserve_k(equations: Equations) -> float:
    """What the coolant loses in five minutes at 8 m/s with an engine that feeds only auxiliaries.

    No more than half of the way from one limit to the other.
    """
    car = equations.vehicle
    th, least = car.thermal, car.thermal.t_cl_min_degc
    shaft_w = max(car.battery.aux_power_w, car.engine.power_min_w)
    burnt_w = float(equations.alpha(least) * equations.fuel_g_per_s(shaft_w)[0])
    burnt_w *= equations.lhv_j_per_g
    warming_w = (1.0 - th.exhaust_share) * (burnt_w - shaft_w)
    to_air_w = float(equations.ua_w_per_k(8.0)) * (least - th.t_amb_degc)
    taken_w = to_air_w + float(equations.cabin_w(least) + equations.radiator_w(least))
    lost_k = 300.0 * (taken_w - warming_w) / th.heat_capacity_j_per_k
    return min(max(lost_k, 0.0), (th.t_cl_max_degc - least) / 2.0)


def stage_program(
    vehicle: Vehicle,
    curves: Curves,
    settings: MhQpSettings,
    road: Horizon,
    state: tuple[float, float],
    about: Expansion,
) -> StageProgram:
    """Write the problem down for one horizon, one state (SOC, degC) and one expansion."""
    equations, battery, th = Equations(vehicle), vehicle.battery, vehicle.thermal
    engine, qp = vehicle.engine, settings.qp
    n = len(road.h)
    rows, same = _Rows(n * COUNT), _Rows(n * COUNT)
    cost = np.zeros(n * COUNT)
    energy = float(equations.voltage_v(vehicle.trip.soc_init)) * 3600.0 * battery.capacity_ah
    lhv, share = equations.lhv_j_per_g, 1.0 - th.exhaust_share
    reach = state[0]
    for k in range(n):
        h, net, off = float(road.h[k]), float(road.net_w[k]), float(road.off_w[k])
        t0, f0, e0, begin, end = (float(part[k]) for part in about)
        at = {name: k * COUNT + name for name in range(COUNT)}
        before = {name: at[name] - COUNT for name in (SOC, T_CL)}
        # alpha and its slope: the piece that is highest at T^
        piece = int(np.argmax(curves.alpha.slope * t0 + curves.alpha.intercept))
        alpha = float(curves.alpha.slope[piece] * t0 + curves.alpha.intercept[piece])
        growth = float(curves.alpha.slope[piece]) * f0
        cost[at[FUEL]] += h * alpha
        cost[at[T_CL]] += 0.5 * h * growth
        if k:
            cost[before[T_CL]] += 0.5 * h * growth
        cost[at[T_SLACK]] += qp.slack_g_per_k

        terms = {at[SOC]: 1.0, at[INTERNAL]: h / energy}
        if k:
            terms[before[SOC]] = -1.0
        same.add("SOC", state[0] if k == 0 else 0.0, terms)

        # T = T_end(q^, T^_begin) + dT/dq (q - q^) + dT/dT_begin (T_before - T^_begin), with
        # q = (1-x)(LHV (alpha F + growth (Tm - T^)) - E) - UA (Tm - T_amb) - Q
        ua = float(equations.ua_w_per_k(road.speed_mps[k]))
        per_mean = ua - share * lhv * growth
        gain = ua * th.t_amb_degc - share * lhv * growth * t0 - float(equations.cabin_w(t0))
        heat = share * (lhv * alpha * f0 - e0) + gain - per_mean * 0.5 * (begin + end)

        def after(q: float, t: float, h: float = h) -> float:
            return equations.coolant_after_degc(h, t, q)

        per_heat = (after(heat + 1.0, begin) - after(heat - 1.0, begin)) / 2.0
        per_begin = (after(heat, begin + 1e-4) - after(heat, begin - 1e-4)) / 2e-4
        loss = 0.5 * per_heat * per_mean
        terms = {
            at[T_CL]: 1.0 + loss,
            at[FUEL]: -per_heat * share * lhv * alpha,
            at[P_ENG]: per_heat * share,
        }
        balance = after(heat, begin) + per_heat * (gain - heat) - per_begin * begin
        if k:
            terms[before[T_CL]] = loss - per_begin
        else:
            balance += (per_begin - loss) * state[1]
        same.add("coolant", balance, terms)

        for a, b in zip(curves.fuel.slope, curves.fuel.intercept, strict=True):
            rows.add("fuel piece", 0.0, {at[FUEL]: -1.0, at[P_ENG]: a, at[ON]: b})
        for c, d in zip(curves.battery.slope, curves.battery.intercept, strict=True):
            # sigma l((sigma P0 - E)/sigma) + (1 - sigma) l(P0) <= G
            terms = {at[INTERNAL]: -1.0, at[P_ENG]: -c, at[ON]: c * net + d - off}
            rows.add("battery piece", -off, terms)
        most = min(engine.power_max_w, net + battery.power_charge_max_w)
        rows.add("engine max", 0.0, {at[P_ENG]: 1.0, at[ON]: -most})
        missing = net - battery.power_discharge_max_w
        rows.add(
            "engine min",
            -max(missing - engine.power_min_w, 0.0),
            {at[P_ENG]: -1.0, at[ON]: engine.power_min_w},
        )
        rows.add("on-share max", 1.0, {at[ON]: 1.0})
        rows.add("on-share min", -(0.99 if missing > 0.0 else 0.0), {at[ON]: -1.0})
        strongest = max(net - engine.power_max_w, -battery.power_charge_max_w)
        charged = float(np.max(curves.battery.slope * strongest + curves.battery.intercept))
        reach -= h * charged / energy
        low, high = battery.soc_min, battery.soc_max
        if h > 1.0:  # forecast: a reserve is left
            low += qp.soc_reserve * max(vehicle.trip.soc_init - low, 0.0)
        if k == n - 1:
            low = max(qp.terminal_low * vehicle.trip.soc_init, battery.soc_min)
            high = min(qp.terminal_high * vehicle.trip.soc_init, high)
        rows.add("SOC max", high, {at[SOC]: 1.0})
        rows.add("SOC min", -min(low, reach - 1e-5), {at[SOC]: -1.0})
        coldest = th.t_cl_min_degc + qp.t_cl_margin_k + _heat_reserve_k(equations)
        rows.add("coolant min", -coldest, {at[T_CL]: -1.0, at[T_SLACK]: -1.0})
        rows.add("coolant max", th.t_cl_max_degc - 0.05, {at[T_CL]: 1.0, at[T_SLACK]: -1.0})
        rows.add("slack", 0.0, {at[T_SLACK]: -1.0})
    return StageProgram(
        cost, np.array(same.a), np.array(same.b), np.array(rows.a), np.array(rows.b), rows.names
    )
