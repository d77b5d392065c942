"""Compiled arithmetic of dynamic programming: plant maps, coasting, the Bellman step.

Every function here is pure. States are SOC and coolant temperature in deg C, powers W, fuel g,
steps 1 s. One file on purpose: the compiler's disk cache looks at the file of a function only,
not at what it calls elsewhere.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.verification.dynamic_programming.compiled import compiled

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Cells = NDArray[np.uint32]

INF = np.inf
ONE = np.uint32(1)
EDGE = 1e-9  # tolerance at the edge of a grid, in cells
MARGIN = 1e-9  # kept from the limits, so that rounding cannot cross them
ROUNDING = 1e-14  # at SOC_max, where the brakes hold the battery exactly
LIMIT_FACTOR = 30.0  # see command_cost
EDGE_FACTOR = 2.0
BISECTIONS = 60
BLOCK = 16  # rows that share one pass over the tables, to stay in the processor's cache
REFINEMENTS = 4
REFINEMENT_POINTS = 5


class Maps(NamedTuple):
    """The plant's numbers; SI, fuel in g."""

    soc_grid: Floats
    open_circuit_v: Floats
    resistance_discharge_ohm: Floats
    resistance_charge_ohm: Floats
    charge_c: float
    power_charge_max_w: float
    aux_power_w: float
    line_power_w: Floats
    line_fuel_g_per_s: Floats
    cold_k: float
    cold_hot_degc: float
    cold_span_k: float
    cold_exponent: float
    lhv_j_per_g: float
    exhaust_share: float
    heat_capacity_j_per_k: float
    ua0_w_per_k: float
    ua1_w_per_k_per_mps: float
    thermostat_open_degc: float
    thermostat_span_k: float
    radiator_w_per_k: float
    t_amb_degc: float
    cabin_heat_w: float
    cabin_heat_from_degc: float
    cabin_heat_full_degc: float
    soc_min: float
    soc_max: float
    t_cl_min_degc: float
    t_cl_max_degc: float
    start_fuel_g: float
    soc_worth_g: float
    t_cl_worth_g_per_k: float


class Lattice(NamedTuple):
    """Where a grid lies: node (i, j) is at origin + (i, j) * spacing."""

    soc_origin: float
    soc_spacing: float
    t_cl_origin: float
    t_cl_spacing: float


class Step(NamedTuple):
    """What one second asks for, which engine powers are allowed, and how many of them to try.

    `coast_*` are the least SOC and T at its end from which the rest is driven with the engine off,
    infinite where there are none.
    """

    demand_w: float
    speed_mps: float
    power_low_w: float
    power_high_w: float
    power_count: int
    on_allowed: bool
    off_allowed: bool
    last: bool
    coast_soc: float
    coast_t_cl_degc: float


# the plant


@compiled
def table(x: float, grid: Floats, values: Floats) -> float:
    """Piecewise-linear lookup, constant beyond both ends."""
    if x <= grid[0]:
        return float(values[0])
    if x >= grid[-1]:
        return float(values[-1])
    low, high = 0, len(grid) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if grid[middle] <= x:
            low = middle
        else:
            high = middle
    slope = (values[high] - values[low]) / (grid[high] - grid[low])
    return float(values[low] + slope * (x - grid[low]))


@compiled
def hot_fuel_g(maps: Maps, power_w: float) -> float:
    """Fuel of the hot engine on its optimal line in one second, engine on."""
    return table(power_w, maps.line_power_w, maps.line_fuel_g_per_s)


@compiled
def alpha(maps: Maps, t_cl: float) -> float:
    """Cold multiplier, 1 + k ((T_hot - T)/span)^e below T_hot, else 1."""
    if t_cl >= maps.cold_hot_degc:
        return 1.0
    cold = (maps.cold_hot_degc - t_cl) / maps.cold_span_k
    return float(1.0 + maps.cold_k * cold**maps.cold_exponent)


@compiled
def losses_w(maps: Maps, t_cl: float, speed_mps: float) -> float:
    """Heat leaving the coolant: Q_air + Q_rad + Q_heat, paper eq. (3)."""
    difference = t_cl - maps.t_amb_degc
    opening = (t_cl - maps.thermostat_open_degc) / maps.thermostat_span_k
    radiator = min(max(opening, 0.0), 1.0) * maps.radiator_w_per_k * difference
    air = (maps.ua0_w_per_k + maps.ua1_w_per_k_per_mps * speed_mps) * difference
    span = maps.cabin_heat_full_degc - maps.cabin_heat_from_degc
    fade = min(max((t_cl - maps.cabin_heat_from_degc) / span, 0.0), 1.0)
    return air + radiator + maps.cabin_heat_w * fade


@compiled
def next_t_cl(maps: Maps, t_cl: float, fuel_g: float, power_w: float, losses: float) -> float:
    """T + [(1 - x)(LHV fuel - P_eng) - losses] / C, paper eq. (3)."""
    heat = (1.0 - maps.exhaust_share) * (fuel_g * maps.lhv_j_per_g - power_w)
    return t_cl + (heat - losses) / maps.heat_capacity_j_per_k


@compiled
def soc_after(maps: Maps, soc: float, p_bat_w: float) -> float:
    """SOC - I / C_bat with I = [U - sqrt(U^2 - 4 R P)] / (2 R), paper eq. (1)."""
    voltage = table(soc, maps.soc_grid, maps.open_circuit_v)
    if p_bat_w >= 0.0:
        resistance = table(soc, maps.soc_grid, maps.resistance_discharge_ohm)
    else:
        resistance = table(soc, maps.soc_grid, maps.resistance_charge_ohm)
    root = max(voltage * voltage - 4.0 * resistance * p_bat_w, 0.0) ** 0.5
    return float(soc - (voltage - root) / (2.0 * resistance) / maps.charge_c)


@compiled
def next_soc(maps: Maps, soc: float, demand_w: float, power_w: float) -> float:
    """SOC after a step with P_bat = P_d + P_aux - P_eng; the brakes take what it cannot.

    Friction brakes take the part of a braking demand that exceeds the charge limit, or would
    fill the battery beyond SOC_max.
    """
    idle_w = maps.aux_power_w - power_w
    after = soc_after(maps, soc, max(demand_w + idle_w, -maps.power_charge_max_w))
    if after > maps.soc_max and demand_w < 0.0:
        after = max(maps.soc_max, soc_after(maps, soc, idle_w))
    return after


@compiled
def power_to_reach(maps: Maps, soc: float, demand_w: float, soc_end: float) -> float:
    """Engine power with which the step ends at `soc_end`, the inverse of `soc_after`.

    P_bat = U I - R I^2 with I = (SOC - SOC_end) C_bat.
    """
    voltage = table(soc, maps.soc_grid, maps.open_circuit_v)
    current = (soc - soc_end) * maps.charge_c
    if current >= 0.0:
        resistance = table(soc, maps.soc_grid, maps.resistance_discharge_ohm)
    else:
        resistance = table(soc, maps.soc_grid, maps.resistance_charge_ohm)
    current = min(current, voltage / (2.0 * resistance))
    return demand_w + maps.aux_power_w - (voltage - resistance * current) * current


# coasting: driving the rest of the cycle with the engine off


@compiled
def off_step(maps: Maps, demand_w: float, speed_mps: float, coolant: bool, x: float) -> float:
    """T, or else SOC, after a step with the engine off; it increases with x."""
    if coolant:
        return next_t_cl(maps, x, 0.0, 0.0, losses_w(maps, x, speed_mps))
    return next_soc(maps, x, demand_w, 0.0)


@compiled
def off_step_inverse(
    maps: Maps,
    demand_w: float,
    speed_mps: float,
    coolant: bool,
    low: float,
    high: float,
    end: float,
) -> float:
    """Return the least x in low..high with off_step(x) >= end; infinity if there is none."""
    if off_step(maps, demand_w, speed_mps, coolant, high) < end:
        return INF
    if off_step(maps, demand_w, speed_mps, coolant, low) >= end:
        return low
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if off_step(maps, demand_w, speed_mps, coolant, middle) < end:
            low = middle
        else:
            high = middle
    return high


@compiled
def coasting_set(
    maps: Maps, demand_w: Floats, speed_mps: Floats, off_allowed: Bools, soc_end: float
) -> tuple[Floats, Floats]:
    """Least SOC and least T at k = 0..n from which the rest is driven with the engine off.

    SOC*_n = soc_end and SOC*_k - I(SOC*_k, P_d + P_aux)/C_bat = SOC*_{k+1}; T* likewise, from
    T_min. Both are infinite where there is no such state. Shapes (n+1,).
    """
    n = len(demand_w)
    soc, t_cl = np.full(n + 1, INF), np.full(n + 1, INF)
    soc[n] = min(soc_end + MARGIN, maps.soc_max - MARGIN)
    t_cl[n] = maps.t_cl_min_degc + MARGIN
    for k in range(n - 1, -1, -1):
        p, v = demand_w[k], speed_mps[k]
        charged = off_step_inverse(maps, p, v, False, maps.soc_min, maps.soc_max, soc[k + 1])
        warm = off_step_inverse(
            maps, p, v, True, maps.t_cl_min_degc, maps.t_cl_max_degc, t_cl[k + 1]
        )
        if not off_allowed[k] or charged == INF or warm == INF:
            break
        soc[k], t_cl[k] = charged, warm
    return soc, t_cl


@compiled
def landing(maps: Maps, step: Step, soc: float, t_cl: float, start_g: float) -> tuple[float, float]:
    """Return fuel and power of the least costly running engine into the coasting set.

    min alpha f(P) + start such that SOC' >= SOC* and T' >= T*. Fuel and both states grow with P,
    so the least admissible P does it. Infinite fuel if there is none.
    """
    nothing = (INF, 0.0)
    if not step.on_allowed or step.coast_soc == INF:
        return nothing
    power = max(power_to_reach(maps, soc, step.demand_w, step.coast_soc), step.power_low_w)
    if power > step.power_high_w:
        return nothing
    factor = alpha(maps, t_cl)
    losses = losses_w(maps, t_cl, step.speed_mps)
    fuel = factor * hot_fuel_g(maps, power) + start_g
    if next_t_cl(maps, t_cl, fuel, power, losses) < step.coast_t_cl_degc:
        low, high = power, step.power_high_w
        fuel = factor * hot_fuel_g(maps, high) + start_g
        if next_t_cl(maps, t_cl, fuel, high, losses) < step.coast_t_cl_degc:
            return nothing
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            fuel = factor * hot_fuel_g(maps, middle) + start_g
            if next_t_cl(maps, t_cl, fuel, middle, losses) < step.coast_t_cl_degc:
                low = middle
            else:
                high = middle
        power = high
        fuel = factor * hot_fuel_g(maps, power) + start_g
    if next_t_cl(maps, t_cl, fuel, power, losses) > maps.t_cl_max_degc - MARGIN:
        return nothing
    after = next_soc(maps, soc, step.demand_w, power)
    if not step.coast_soc - 0.1 * MARGIN <= after <= maps.soc_max + ROUNDING:
        return nothing
    return fuel, power


# interpolation


@compiled
def on_axis(position: float, points: int) -> float:
    """Clamp a position to an axis."""
    return min(max(position, 0.0), points - 1.0)


@compiled
def cell(position: float, points: int) -> tuple[int, float]:
    """Split a position on an axis, clamped to it, into lower node and weight of the upper one."""
    position = on_axis(position, points)
    lower = min(int(position), points - 2)
    return lower, position - lower


@compiled
def outside(position: float, points: int) -> bool:
    """Tell whether a position lies off an axis."""
    return position < -EDGE or position > points - 1.0 + EDGE


@compiled
def interpolate(value: Floats, row: float, column: float) -> float:
    """Bilinear interpolation of value[i, j] at a position in cells, clamped to the grid."""
    i, a = cell(row, value.shape[0])
    j, b = cell(column, value.shape[1])
    lower = (1.0 - b) * value[i, j] + b * value[i, j + 1]
    upper = (1.0 - b) * value[i + 1, j] + b * value[i + 1, j + 1]
    return float((1.0 - a) * lower + a * upper)


@compiled
def gradient(value: Floats, row: float, column: float) -> tuple[float, float]:
    """Slopes per cell: differences over +-1 cell, one-sided at the edges."""
    low, high = max(row - 1.0, 0.0), min(row + 1.0, value.shape[0] - 1.0)
    rise = interpolate(value, high, column) - interpolate(value, low, column)
    left, right = max(column - 1.0, 0.0), min(column + 1.0, value.shape[1] - 1.0)
    run = interpolate(value, row, right) - interpolate(value, row, left)
    return rise / (high - low), run / (right - left)


# the Bellman step


@compiled
def grid_power_w(step: Step, u: int) -> float:
    """Engine power number u = 0..power_count-1 over the allowed range."""
    share = u / (step.power_count - 1.0)
    return step.power_low_w + share * (step.power_high_w - step.power_low_w)


@compiled
def command_cost(
    maps: Maps,
    step: Step,
    state: tuple[float, float],
    start_g: float,
    on: bool,
    power: float,
    following: Floats,
    target: Lattice,
    strict: bool,
) -> float:
    """Fuel of one command plus W_{k+1} where it leads.

    Leaving limits or grid costs infinity if `strict`. Else each unit beyond a limit costs
    LIMIT_FACTOR times the fuel that would make up for it, and each unit beyond the grid
    EDGE_FACTOR times. More charge than the grid holds is given away: charge never harms.
    """
    soc, t_cl = state
    states, rows, columns = following.shape
    fuel = alpha(maps, t_cl) * hot_fuel_g(maps, power) + start_g if on else 0.0
    t_end = next_t_cl(maps, t_cl, fuel, power, losses_w(maps, t_cl, step.speed_mps))
    soc_end = next_soc(maps, soc, step.demand_w, power)
    row = (soc_end - target.soc_origin) / target.soc_spacing
    column = (t_end - target.t_cl_origin) / target.t_cl_spacing
    if strict:
        if (
            outside(row, rows)
            or outside(column, columns)
            or not maps.soc_min + MARGIN <= soc_end <= maps.soc_max + ROUNDING
            or not maps.t_cl_min_degc + MARGIN <= t_end <= maps.t_cl_max_degc - MARGIN
        ):
            return INF
        penalty = 0.0
    else:
        least_soc = max(step.coast_soc, maps.soc_min) if step.last else maps.soc_min
        soc_excess = max(least_soc - soc_end, soc_end - maps.soc_max, 0.0)
        t_excess = max(maps.t_cl_min_degc - t_end, t_end - maps.t_cl_max_degc, 0.0)
        t_beyond = abs(t_end - target.t_cl_origin - on_axis(column, columns) * target.t_cl_spacing)
        soc_below = max(target.soc_origin - soc_end, 0.0)
        penalty = maps.soc_worth_g * (LIMIT_FACTOR * soc_excess + EDGE_FACTOR * soc_below)
        penalty += maps.t_cl_worth_g_per_k * (LIMIT_FACTOR * t_excess + EDGE_FACTOR * t_beyond)
    if step.last:
        return fuel + penalty
    after = 1 if on and states == 2 else 0
    return fuel + penalty + interpolate(following[after], row, column)


@compiled
def least_penalised(
    maps: Maps,
    step: Step,
    state: tuple[float, float],
    start_g: float,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float]:
    """Return cost, on or off, and power of the command that leaves the grid by the least."""
    best, best_on, best_power = INF, False, 0.0
    if step.off_allowed:
        best = command_cost(maps, step, state, start_g, False, 0.0, following, target, False)
    if step.on_allowed:
        for u in range(step.power_count):
            power = grid_power_w(step, u)
            cost = command_cost(maps, step, state, start_g, True, power, following, target, False)
            if cost < best:
                best, best_on, best_power = cost, True, power
    return best, best_on, best_power


@compiled
def temperature_tables(
    maps: Maps,
    step: Step,
    t_axis: Floats,
    target: Lattice,
    columns: int,
    fuel: Floats,
    column: Cells,
    weight: Floats,
) -> None:
    """Fill fuel and next T, as cell and weight, for all engine states e, inputs u, temperatures j.

    Input u = 0 is off, u >= 1 power u - 1 of `grid_power_w`. Shapes (2 or 1, count+1, nt); fuel
    is infinite where the next T leaves the grid of `columns` nodes. Two engine states exist only
    with a start cost: e = 0, off before, and e = 1, on before.
    """
    states, nt = fuel.shape[0], len(t_axis)
    factor, losses = np.empty(nt), np.empty(nt)
    for j in range(nt):
        factor[j] = alpha(maps, t_axis[j])
        losses[j] = losses_w(maps, t_axis[j], step.speed_mps)
    for u in range(step.power_count + 1):
        power = grid_power_w(step, u - 1) if u > 0 else 0.0
        hot = hot_fuel_g(maps, power) if u > 0 else 0.0
        for e in range(states):
            start_g = maps.start_fuel_g if u > 0 and states == 2 and e == 0 else 0.0
            for j in range(nt):
                used = factor[j] * hot + start_g
                end = next_t_cl(maps, t_axis[j], used, power, losses[j])
                position = (end - target.t_cl_origin) / target.t_cl_spacing
                fuel[e, u, j] = INF if outside(position, columns) else used
                column[e, u, j], weight[e, u, j] = cell(position, columns)


@compiled
def mix(lower: Floats, upper: Floats, share: float, result: Floats) -> None:
    """Interpolate between two rows: result = (1 - share) lower + share upper."""
    for j in range(len(result)):
        result[j] = (1.0 - share) * lower[j] + share * upper[j]


@compiled
def improve(value: Floats, fuel: Floats, column: Cells, weight: Floats, row: Floats) -> None:
    """Take the minimum: value_j = min(value_j, fuel_j + row at column_j + weight_j)."""
    for j in range(len(value)):
        c = column[j]
        cost = fuel[j] + row[c] + weight[j] * (row[c + ONE] - row[c])
        value[j] = cost if cost < value[j] else value[j]


@compiled
def bellman_rows(
    first: int,
    stop: int,
    maps: Maps,
    step: Step,
    soc_axis: Floats,
    t_axis: Floats,
    target: Lattice,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    following: Floats,
    value: Floats,
) -> None:
    """One Bellman step for rows first..stop-1 of the SOC axis.

    W_k(x, e) = min{ W_{k+1}(x'_off, 0),
                     min_P alpha f(P) + start + W_{k+1}(x'_P, 1),
                     min_P alpha f(P) + start   over x'_P in the coasting set of k+1 }

    over inputs that keep x' on the grid of k+1; where none does, the least penalised one.
    `following` and `value` are W_{k+1} and W_k, shape (2 or 1, ns, nt).
    """
    states, rows, columns = following.shape
    mixed = np.empty(columns)
    for begin in range(first, stop, BLOCK):
        end = min(begin + BLOCK, stop)
        value[:, begin:end, :] = INF
        for u in range(0 if step.last else step.power_count + 1):
            if not (step.on_allowed if u > 0 else step.off_allowed):
                continue
            power = grid_power_w(step, u - 1) if u > 0 else 0.0
            after = 1 if u > 0 and states == 2 else 0
            for i in range(begin, end):
                soc = next_soc(maps, soc_axis[i], step.demand_w, power)
                position = (soc - target.soc_origin) / target.soc_spacing
                if outside(position, rows):
                    continue
                lower, share = cell(position, rows)
                mix(following[after, lower], following[after, lower + 1], share, mixed)
                for e in range(states):
                    improve(value[e, i], fuel[e, u], column[e, u], weight[e, u], mixed)
    for e in range(states):
        start_g = maps.start_fuel_g if states == 2 and e == 0 else 0.0
        for i in range(first, stop):
            for j in range(len(t_axis)):
                if step.coast_soc < INF:
                    cost, _ = landing(maps, step, soc_axis[i], t_axis[j], start_g)
                    value[e, i, j] = min(value[e, i, j], cost)
                if value[e, i, j] == INF:
                    state = (soc_axis[i], t_axis[j])
                    value[e, i, j], _, _ = least_penalised(
                        maps, step, state, start_g, following, target
                    )


@compiled
def best_command(
    maps: Maps,
    step: Step,
    state: tuple[float, float],
    engine_on: bool,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float, bool]:
    """Minimise the right-hand side of the Bellman step at any state, over continuous power.

    Returns
    -------
    cost, on or off, power, and whether the command is admissible
    """
    start_g = 0.0 if engine_on else maps.start_fuel_g
    best, best_on, best_power = INF, False, 0.0
    if step.off_allowed and not step.last:
        best = command_cost(maps, step, state, start_g, False, 0.0, following, target, True)
    if step.on_allowed and not step.last:
        spacing = (step.power_high_w - step.power_low_w) / (step.power_count - 1.0)
        on_best, centre, points = INF, step.power_low_w, step.power_count - 1
        for _ in range(REFINEMENTS + 1):
            around = centre
            for u in range(-points, points + 1):
                power = min(max(around + u * spacing, step.power_low_w), step.power_high_w)
                cost = command_cost(
                    maps, step, state, start_g, True, power, following, target, True
                )
                if cost < on_best:
                    on_best, centre = cost, power
            points = REFINEMENT_POINTS
            spacing /= points
        if on_best < best:
            best, best_on, best_power = on_best, True, centre
    cost, power = landing(maps, step, state[0], state[1], start_g)
    if cost < best:
        best, best_on, best_power = cost, True, power
    if best < INF:
        return best, best_on, best_power, True
    best, best_on, best_power = least_penalised(maps, step, state, start_g, following, target)
    return best, best_on, best_power, False
