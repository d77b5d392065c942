"""The multi-horizon problem written a second time: stages and QP, from equations, in SI units.

Plain loops, stage by stage, without `qpmpc.qp` or `qpmpc.preview`: their results must agree with
this.
"""

from dataclasses import dataclass
from itertools import pairwise
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

# variables of a stage, in the product's order; the last where a start costs something
SOC, T_CL, P_ENG, ON, FUEL, INTERNAL, T_SLACK, START = range(8)


@dataclass(frozen=True)
class Horizon:
    """Duration (s), P0 (W), mean speed (m/s) and mean l(P0) (W) of each stage; shape (n,).

    `must`: share of the seconds with the engine on in any case; `free_net_w`, `free_off_w`: means
    over the others, over all if there are none. `rises`: starts in the stage for an on-share that
    is one more than that of the stage before.
    `low_j`, `high_j`: energy to keep from the SOC limits, -inf where there is none.
    """

    h: Floats
    net_w: Floats
    speed_mps: Floats
    off_w: Floats
    must: Floats
    free_net_w: Floats
    free_off_w: Floats
    rises: Floats
    low_j: Floats
    high_j: Floats


def horizon(
    cycle: Cycle, vehicle: Vehicle, settings: MhQpSettings, step: int, held_s: int = 0
) -> Horizon:
    """Stages at one time step, from the cycle, for an exact forecast.

    For `held_s` of the coming seconds an engine that runs has to go on.

    The next N seconds one by one; then what is left, in equal blocks, or in blocks of N seconds
    where that is more; each split into hard, easy and braking seconds.
    On from the hard to the easy seconds of a block the engine stops, and
    starts again, as often as the demand rises into the hard ones; likewise from easy to braking. A
    part of the first of these starts is counted where the block is entered, by what is on there and
    was not in the last seconds before.
    """
    grid, equations = settings.horizon, Equations(vehicle)
    demand, net = equations.demand_w(cycle), equations.net_w(cycle)
    speed = 0.5 * (cycle.speed_mps[:-1] + cycle.speed_mps[1:])
    give = np.minimum(net, equations.discharge_max_w)
    off = equations.internal_w(_mean_soc(vehicle), give)
    must = (net > equations.discharge_max_w) | (speed - vehicle.engine.electric_max_mps >= 1e-5)
    runs = must.copy()  # a run that the engine has to begin lasts
    for t in np.flatnonzero(must).tolist():
        if t == 0 or not must[t - 1]:
            runs[t : t + vehicle.engine.min_on_s] = True
    steps = cycle.steps
    n = grid.short_stages
    rows: list[list[float]] = []
    for t in range(step, step + n):
        if t >= steps:
            rows.append([0.0] * 10)
            continue
        on = must[t] or t - step < held_s
        rows.append([1.0, net[t], speed[t], off[t], on, net[t], off[t], 1.0, 0.0, 0.0])
    for seconds in _blocks(range(step + n, steps), grid.blocks, n):
        classes: list[list[int]] = [[], [], []]
        for t in seconds:
            hard, braking = demand[t] > grid.class_hard_w, demand[t] < grid.class_braking_w
            classes[0 if hard else 2 if braking else 1].append(t)
        into_hard = [t for t in seconds if demand[t - 1] <= grid.class_hard_w < demand[t]]
        off_braking = [t for t in seconds if demand[t - 1] < grid.class_braking_w <= demand[t]]
        has = [number for number, member in enumerate(classes) if member]
        starts = [grid.entry_share] * 3
        for number, entries in ((1, into_hard), (2, off_braking)):
            if has and has[0] < number <= has[-1]:
                starts[number] = -grid.rise_share * max(len(entries) - grid.entry_share, 0.0)
        for member, rises in zip(classes, starts, strict=True):
            means = [0.0] * 6
            if member:
                free = [t for t in member if not runs[t]] or member
                means = [float(np.mean(a[member])) for a in (net, speed, off, runs)]
                means += [float(np.mean(a[free])) for a in (net, off)]
            swing = [-np.inf, -np.inf]  # inside a block SOC is not limited
            rows.append([float(len(member)), *means, rises, *swing])
        place_s = -(-steps // grid.blocks)
        kept_j = [0.0, 0.0]
        if seconds:
            place = seconds[-1] // place_s
            kept_j = _kept_j(place * place_s, place_s, off, demand, vehicle, settings)
        rows[-1][8:] = kept_j
    return Horizon(*np.array(rows).T)


def _blocks(left: range, count: int, least_s: int) -> list[range]:
    """What is left of the trip in that many blocks, the first of them empty near arrival."""
    if len(left) >= count * least_s:
        return [left[len(left) * k // count : len(left) * (k + 1) // count] for k in range(count)]
    whole, rest = divmod(len(left), least_s)
    ends = [0] * (count - whole) + [rest + k * least_s for k in range(whole + 1)]
    return [left[a:b] for a, b in pairwise(ends)]


def _target_soc(vehicle: Vehicle) -> float:
    """SOC to arrive with."""
    trip = vehicle.trip
    return trip.soc_init if trip.soc_end is None else trip.soc_end


def _mean_soc(vehicle: Vehicle) -> float:
    """Half way between departure and arrival, where the battery's curves are taken."""
    return (vehicle.trip.soc_init + _target_soc(vehicle)) / 2.0


def _kept_j(
    first: int,
    length: int,
    off_w: Floats,
    demand_w: Floats,
    vehicle: Vehicle,
    settings: MhQpSettings,
) -> list[float]:
    """Energy kept from both SOC limits at the end of a place: of the swing in it and in the next.

    The engine rests outside hard driving, and makes up for all of it evenly in hard driving.
    """
    battery, kept = vehicle.battery, [0.0, 0.0]
    for begin in (first, first + length):
        seconds = range(begin, min(begin + length, len(demand_w)))
        hard = [t for t in seconds if demand_w[t] > settings.horizon.class_hard_w]
        drained = sum(off_w[t] for t in seconds if t not in hard)
        level = 0.0
        for t in seconds:
            level -= 0.0 if t in hard else off_w[t]
            level += drained / len(hard or seconds) if not hard or t in hard else 0.0
            kept = [max(kept[0], -level), max(kept[1], level)]
    volts = float(Equations(vehicle).voltage_v(_mean_soc(vehicle)))
    half = 0.5 * (battery.soc_max - battery.soc_min) * volts * 3600.0 * battery.capacity_ah
    fall, rise = (min(settings.horizon.swing_share * each, half) for each in kept)
    return [max(fall / 2.0, 1.0), max(rise, 1.0)]


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
    previous : solution of the step before, SI units, shape (stages, variables)
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

    stages: int
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


def _refill_j(road: Horizon, k: int) -> float:
    """Most that braking puts into the battery from a block's end k to a later one, engine off."""
    ends = np.flatnonzero(road.low_j > 0.0)
    stored = -np.cumsum(road.h * road.off_w)
    return float(np.max(stored[ends[ends >= k]]) - stored[k])


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


def _coolant_floor_degc(
    equations: Equations, road: Horizon, soc: float, coldest: float, energy_j: float
) -> Floats:
    """Coolant needed at the end of each stage, because later the battery will be full.

    Forwards the battery as empty as the trip ahead allows, for it takes what the engine makes;
    backwards the coolant that is lost beyond the engine's largest heat.
    """
    car, n = equations.vehicle, len(road.h)
    cell, engine, th = car.battery, car.engine, car.thermal
    charge, gain = min(max(soc, cell.soc_min), cell.soc_max), np.zeros(n)
    for k in range(n):
        h, net = float(road.h[k]), float(road.net_w[k])
        share = 1.0 - min(max(-net, 0.0), equations.charge_max_w) / equations.charge_max_w
        taken_w = 0.5 * (cell.soc_max - charge) * energy_j * share / max(h, 1.0)
        shaft = max(net, cell.aux_power_w) + min(taken_w, equations.charge_max_w)
        shaft = min(max(shaft, engine.power_min_w), engine.power_max_w)
        burnt = float(equations.alpha(th.t_cl_min_degc) * equations.fuel_g_per_s(shaft)[0])
        kept = (1.0 - th.exhaust_share) * (burnt * equations.lhv_j_per_g - shaft)
        gain[k] = h * kept / th.heat_capacity_j_per_k
        charge = min(max(charge - h * float(road.off_w[k]) / energy_j, cell.soc_min), cell.soc_max)
    slack_k = 0.005  # at arrival, where heat is worth nothing; the safety layer asks for 0.004
    floor = np.full(n, min(th.t_cl_min_degc + slack_k, coldest))
    rest_k = floor[-1]  # an engine that rests from here on arrives with that
    most = max(coldest, (th.t_cl_min_degc + th.t_cl_max_degc) / 2.0)
    for k in range(n - 1, 0, -1):
        air = float(equations.ua_w_per_k(road.speed_mps[k])) * (floor[k] - th.t_amb_degc)
        rest = float(equations.cabin_w(floor[k]) + equations.radiator_w(floor[k]))
        lost = float(road.h[k]) * (air + rest) / th.heat_capacity_j_per_k
        rest_k = min(coldest, rest_k + lost)
        floor[k - 1] = min(max(rest_k, floor[k] + lost - gain[k]), most)
    return floor


def stage_program(
    vehicle: Vehicle,
    curves: Curves,
    settings: MhQpSettings,
    road: Horizon,
    state: tuple[float, float, bool],
    about: Expansion,
) -> StageProgram:
    """Write the problem down for one horizon, one state and one expansion.

    `state`: SOC, degC, whether the engine runs.
    """
    equations, battery, th = Equations(vehicle), vehicle.battery, vehicle.thermal
    engine, qp = vehicle.engine, settings.qp
    n = len(road.h)
    starts_cost = engine.start_fuel_g > 0.0 or engine.start_energy_j > 0.0
    count = START + starts_cost
    rows, same = _Rows(n * count), _Rows(n * count)
    cost = np.zeros(n * count)
    energy = float(equations.voltage_v(_mean_soc(vehicle))) * 3600.0 * battery.capacity_ah
    target = _target_soc(vehicle)
    lhv, share = equations.lhv_j_per_g, 1.0 - th.exhaust_share
    reach = state[0]
    coldest = th.t_cl_min_degc + qp.t_cl_margin_k + _heat_reserve_k(equations)
    floor = _coolant_floor_degc(equations, road, state[0], coldest, energy)
    on_curve = [
        float(np.max(curves.fuel.slope * p + curves.fuel.intercept))
        for p in (0.0, engine.power_max_w)
    ]
    idle_w = battery.aux_power_w
    drawn_w = [
        float(np.max(curves.battery.slope * p + curves.battery.intercept))
        for p in (idle_w, idle_w + engine.start_energy_j)
    ]
    crank_j = drawn_w[1] - drawn_w[0]  # within a second
    per_w = (on_curve[1] - on_curve[0]) / engine.power_max_w
    for k in range(n):
        h, net = float(road.h[k]), float(road.net_w[k])
        free, free_off = float(road.free_net_w[k]), float(road.free_off_w[k])
        t0, f0, e0, begin, end = (float(part[k]) for part in about)
        at = {name: k * count + name for name in range(count)}
        before = {name: at[name] - count for name in (SOC, T_CL, ON)}
        # alpha and its slope: the piece that is highest at T^
        piece = int(np.argmax(curves.alpha.slope * t0 + curves.alpha.intercept))
        alpha = float(curves.alpha.slope[piece] * t0 + curves.alpha.intercept[piece])
        growth = float(curves.alpha.slope[piece]) * f0
        cost[at[FUEL]] += h * alpha
        cost[at[T_CL]] += 0.5 * h * growth
        if k:
            cost[before[T_CL]] += 0.5 * h * growth
        cost[at[T_SLACK]] += qp.slack_g_per_k
        if starts_cost:
            cost[at[START]] = engine.start_fuel_g

        terms = {at[SOC]: 1.0, at[INTERNAL]: h / energy}
        if starts_cost:
            terms[at[START]] = crank_j / energy
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
        if starts_cost:  # heat of all starts, spread over the stage
            terms[at[START]] = -per_heat * share * lhv * engine.start_fuel_g / max(h, 1.0)
        balance = after(heat, begin) + per_heat * (gain - heat) - per_begin * begin
        if k:
            terms[before[T_CL]] = loss - per_begin
        else:
            balance += (per_begin - loss) * state[1]
        same.add("coolant", balance, terms)

        for a, b in zip(curves.fuel.slope, curves.fuel.intercept, strict=True):
            rows.add("fuel piece", 0.0, {at[FUEL]: -1.0, at[P_ENG]: a, at[ON]: b})
        # no fuel above the chord of its curve where heat is needed in good time
        wasted = 0.0 if floor.max() > coldest else 5.0
        rows.add("fuel most", wasted, {at[FUEL]: 1.0, at[P_ENG]: -per_w, at[ON]: -on_curve[0]})
        for c, d in zip(curves.battery.slope, curves.battery.intercept, strict=True):
            # sigma l((on - E)/sigma) + (1 - sigma) l(free P0) <= G, where the engine takes the
            # seconds without a choice, and of the others its share: on = P0 - (1 - sigma) free P0
            terms = {at[INTERNAL]: -1.0, at[P_ENG]: -c, at[ON]: c * free + d - free_off}
            rows.add("battery piece", -free_off - c * (net - free), terms)
        taken = net + equations.charge_max_w
        if road.must[k] > 0.0:  # the engine turns, at its least power where the battery takes less
            taken = max(taken, engine.power_min_w)
        most = min(engine.power_max_w, taken)
        rows.add("engine max", 0.0, {at[P_ENG]: 1.0, at[ON]: -most})
        missing = net - equations.discharge_max_w
        rows.add(
            "engine min",
            -max(missing - engine.power_min_w, 0.0),
            {at[P_ENG]: -1.0, at[ON]: engine.power_min_w},
        )
        rows.add("on-share max", 1.0, {at[ON]: 1.0})
        rows.add("on-share min", -0.99 * float(road.must[k]), {at[ON]: -1.0})
        strongest = max(net - engine.power_max_w, -equations.charge_max_w)
        charged = float(np.max(curves.battery.slope * strongest + curves.battery.intercept))
        reach -= h * charged / energy
        low = battery.soc_min + 1e-3 + float(road.low_j[k]) / energy
        high = battery.soc_max - float(road.high_j[k]) / energy
        if road.low_j[k] > 0.0:  # a block ends: a reserve is left, half of it where cool
            part = 1.0 if t0 > th.thermostat_open_degc else 0.5
            lower = min(vehicle.trip.soc_init, target)
            reserve = part * qp.soc_reserve * max(lower - battery.soc_min, 0.0)
            low += max(reserve - _refill_j(road, k) / energy, 0.0)
        if k == n - 1:
            low = max(qp.terminal_low * target, battery.soc_min)
            high = min(qp.terminal_high * target, battery.soc_max)
            if vehicle.trip.soc_end_at_least:
                low, high = target, battery.soc_max
        low = min(low, reach - 1e-5 - crank_j / energy)
        if np.isfinite(high):
            rows.add("SOC max", max(high, low), {at[SOC]: 1.0})
        if np.isfinite(low):
            rows.add("SOC min", -low, {at[SOC]: -1.0})
        rows.add("coolant min", -float(floor[k]), {at[T_CL]: -1.0, at[T_SLACK]: -1.0})
        rows.add("coolant max", th.t_cl_max_degc - 0.05, {at[T_CL]: 1.0, at[T_SLACK]: -1.0})
        rows.add("slack", 0.0, {at[T_SLACK]: -1.0})
        if starts_cost:
            rise = float(road.rises[k])
            terms = {at[START]: -1.0, at[ON]: rise}
            if k:
                terms[before[ON]] = -rise
            rows.add("starts", rise * state[2] if k == 0 else 0.0, terms)
            rows.add("no negative starts", 0.0, {at[START]: -1.0})
    return StageProgram(
        n, cost, np.array(same.a), np.array(same.b), np.array(rows.a), np.array(rows.b), rows.names
    )
