"""Compiled arithmetic of dynamic programming: plant maps, coasting, the Bellman step.

Every function here is pure. States are SOC and coolant temperature in deg C, powers W, fuel g,
steps 1 s. One file on purpose: the compiler's disk cache looks at the file of a function only,
not at what it calls elsewhere.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.verification.dynamic_programming.compiled import compiled, inlined

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Cells = NDArray[np.uint32]
Battery = tuple[float, float, float]  # open-circuit voltage, resistances of discharge and charge

INF = np.inf
ONE = np.uint64(1)
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
    """The plant's tables: battery over SOC, fuel over power on the optimal line; SI, fuel in g."""

    soc_grid: Floats
    open_circuit_v: Floats
    resistance_discharge_ohm: Floats
    resistance_charge_ohm: Floats
    line_power_w: Floats
    line_fuel_g_per_s: Floats


class Constants(NamedTuple):
    """The plant's other numbers. Arrays beside them would be reference-counted in every call."""

    charge_c: float
    power_charge_max_w: float
    aux_power_w: float
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


class State(NamedTuple):
    """A state, and what depends on it alone."""

    soc: float
    t_cl: float
    battery: Battery
    alpha: float
    losses_w: float


# the plant


@inlined
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


@inlined
def hot_fuel_g(maps: Maps, power_w: float) -> float:
    """Fuel of the hot engine on its optimal line in one second, engine on."""
    return table(power_w, maps.line_power_w, maps.line_fuel_g_per_s)


@inlined
def alpha(constants: Constants, t_cl: float) -> float:
    """Cold multiplier, 1 + k ((T_hot - T)/span)^e below T_hot, else 1."""
    if t_cl >= constants.cold_hot_degc:
        return 1.0
    cold = (constants.cold_hot_degc - t_cl) / constants.cold_span_k
    return float(1.0 + constants.cold_k * cold**constants.cold_exponent)


@inlined
def losses_w(constants: Constants, t_cl: float, speed_mps: float) -> float:
    """Heat leaving the coolant: Q_air + Q_rad + Q_heat, paper eq. (3)."""
    difference = t_cl - constants.t_amb_degc
    opening = (t_cl - constants.thermostat_open_degc) / constants.thermostat_span_k
    radiator = min(max(opening, 0.0), 1.0) * constants.radiator_w_per_k * difference
    air = (constants.ua0_w_per_k + constants.ua1_w_per_k_per_mps * speed_mps) * difference
    span = constants.cabin_heat_full_degc - constants.cabin_heat_from_degc
    fade = min(max((t_cl - constants.cabin_heat_from_degc) / span, 0.0), 1.0)
    return air + radiator + constants.cabin_heat_w * fade


@inlined
def next_t_cl(
    constants: Constants, t_cl: float, fuel_g: float, power_w: float, losses: float
) -> float:
    """T + [(1 - x)(LHV fuel - P_eng) - losses] / C, paper eq. (3)."""
    heat = (1.0 - constants.exhaust_share) * (fuel_g * constants.lhv_j_per_g - power_w)
    return t_cl + (heat - losses) / constants.heat_capacity_j_per_k


@inlined
def battery_at(maps: Maps, soc: float) -> Battery:
    """Look up open-circuit voltage and the resistances of discharge and charge."""
    return (
        table(soc, maps.soc_grid, maps.open_circuit_v),
        table(soc, maps.soc_grid, maps.resistance_discharge_ohm),
        table(soc, maps.soc_grid, maps.resistance_charge_ohm),
    )


@inlined
def soc_after(constants: Constants, soc: float, battery: Battery, p_bat_w: float) -> float:
    """SOC - I / C_bat with I = [U - sqrt(U^2 - 4 R P)] / (2 R), paper eq. (1)."""
    voltage, discharge, charge = battery
    resistance = discharge if p_bat_w >= 0.0 else charge
    root = max(voltage * voltage - 4.0 * resistance * p_bat_w, 0.0) ** 0.5
    return float(soc - (voltage - root) / (2.0 * resistance) / constants.charge_c)


@inlined
def next_soc_of(
    constants: Constants, soc: float, battery: Battery, demand_w: float, power_w: float
) -> float:
    """SOC after a step with P_bat = P_d + P_aux - P_eng; the brakes take what it cannot.

    Friction brakes take the part of a braking demand that exceeds the charge limit, or would
    fill the battery beyond SOC_max. `battery` is `battery_at` this SOC.
    """
    idle_w = constants.aux_power_w - power_w
    after = soc_after(
        constants, soc, battery, max(demand_w + idle_w, -constants.power_charge_max_w)
    )
    if after > constants.soc_max and demand_w < 0.0:
        after = max(constants.soc_max, soc_after(constants, soc, battery, idle_w))
    return after


@inlined
def next_soc(
    maps: Maps, constants: Constants, soc: float, demand_w: float, power_w: float
) -> float:
    """SOC after a step, the battery looked up; see `next_soc_of`."""
    return next_soc_of(constants, soc, battery_at(maps, soc), demand_w, power_w)


@inlined
def power_to_reach(
    constants: Constants, soc: float, battery: Battery, demand_w: float, soc_end: float
) -> float:
    """Engine power with which the step ends at `soc_end`, the inverse of `soc_after`.

    P_bat = U I - R I^2 with I = (SOC - SOC_end) C_bat.
    """
    voltage, discharge, charge = battery
    current = (soc - soc_end) * constants.charge_c
    resistance = discharge if current >= 0.0 else charge
    current = min(current, voltage / (2.0 * resistance))
    return demand_w + constants.aux_power_w - (voltage - resistance * current) * current


# coasting: driving the rest of the cycle with the engine off


@inlined
def off_step(
    maps: Maps, constants: Constants, demand_w: float, speed_mps: float, coolant: bool, x: float
) -> float:
    """T, or else SOC, after a step with the engine off; it increases with x."""
    if coolant:
        return next_t_cl(constants, x, 0.0, 0.0, losses_w(constants, x, speed_mps))
    return next_soc(maps, constants, x, demand_w, 0.0)


@inlined
def off_step_inverse(
    maps: Maps,
    constants: Constants,
    demand_w: float,
    speed_mps: float,
    coolant: bool,
    low: float,
    high: float,
    end: float,
) -> float:
    """Return the least x in low..high with off_step(x) >= end; infinity if there is none."""
    if off_step(maps, constants, demand_w, speed_mps, coolant, high) < end:
        return INF
    if off_step(maps, constants, demand_w, speed_mps, coolant, low) >= end:
        return low
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if off_step(maps, constants, demand_w, speed_mps, coolant, middle) < end:
            low = middle
        else:
            high = middle
    return high


@compiled
def coasting_set(
    maps: Maps,
    constants: Constants,
    demand_w: Floats,
    speed_mps: Floats,
    off_allowed: Bools,
    soc_end: float,
) -> tuple[Floats, Floats]:
    """Least SOC and least T at k = 0..n from which the rest is driven with the engine off.

    SOC*_n = soc_end and SOC*_k - I(SOC*_k, P_d + P_aux)/C_bat = SOC*_{k+1}; T* likewise, from
    T_min. Both are infinite where there is no such state. Shapes (n+1,).
    """
    n = len(demand_w)
    soc, t_cl = np.full(n + 1, INF), np.full(n + 1, INF)
    soc[n] = min(soc_end + MARGIN, constants.soc_max - MARGIN)
    t_cl[n] = constants.t_cl_min_degc + MARGIN
    for k in range(n - 1, -1, -1):
        p, v = demand_w[k], speed_mps[k]
        charged = off_step_inverse(
            maps, constants, p, v, False, constants.soc_min, constants.soc_max, soc[k + 1]
        )
        warm = off_step_inverse(
            maps,
            constants,
            p,
            v,
            True,
            constants.t_cl_min_degc,
            constants.t_cl_max_degc,
            t_cl[k + 1],
        )
        if not off_allowed[k] or charged == INF or warm == INF:
            break
        soc[k], t_cl[k] = charged, warm
    return soc, t_cl


@compiled
def landing(
    maps: Maps, constants: Constants, step: Step, state: State, start_g: float
) -> tuple[float, float]:
    """Return fuel and power of the least costly running engine into the coasting set.

    min alpha f(P) + start such that SOC' >= SOC* and T' >= T*. Fuel and both states grow with P,
    so the least admissible P does it. Infinite fuel if there is none.
    """
    nothing = (INF, 0.0)
    if not step.on_allowed or step.coast_soc == INF:
        return nothing
    power = max(
        power_to_reach(constants, state.soc, state.battery, step.demand_w, step.coast_soc),
        step.power_low_w,
    )
    if power > step.power_high_w:
        return nothing
    fuel = state.alpha * hot_fuel_g(maps, power) + start_g
    if next_t_cl(constants, state.t_cl, fuel, power, state.losses_w) < step.coast_t_cl_degc:
        low, high = power, step.power_high_w
        fuel = state.alpha * hot_fuel_g(maps, high) + start_g
        if next_t_cl(constants, state.t_cl, fuel, high, state.losses_w) < step.coast_t_cl_degc:
            return nothing
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            fuel = state.alpha * hot_fuel_g(maps, middle) + start_g
            if (
                next_t_cl(constants, state.t_cl, fuel, middle, state.losses_w)
                < step.coast_t_cl_degc
            ):
                low = middle
            else:
                high = middle
        power = high
        fuel = state.alpha * hot_fuel_g(maps, power) + start_g
    if (
        next_t_cl(constants, state.t_cl, fuel, power, state.losses_w)
        > constants.t_cl_max_degc - MARGIN
    ):
        return nothing
    after = next_soc_of(constants, state.soc, state.battery, step.demand_w, power)
    if not step.coast_soc - 0.1 * MARGIN <= after <= constants.soc_max + ROUNDING:
        return nothing
    return fuel, power


# interpolation


@inlined
def on_axis(position: float, points: int) -> float:
    """Clamp a position to an axis."""
    return min(max(position, 0.0), points - 1.0)


@inlined
def cell(position: float, points: int) -> tuple[int, float]:
    """Split a position on an axis, clamped to it, into lower node and weight of the upper one."""
    position = on_axis(position, points)
    lower = min(int(position), points - 2)
    return lower, position - lower


@inlined
def outside(position: float, points: int) -> bool:
    """Tell whether a position lies off an axis."""
    return position < -EDGE or position > points - 1.0 + EDGE


@inlined
def interpolate(value: Floats, e: int, row: float, column: float) -> float:
    """Bilinear interpolation of value[e, i, j] at a position in cells, clamped to the grid."""
    i, a = cell(row, value.shape[1])
    j, b = cell(column, value.shape[2])
    lower = (1.0 - b) * value[e, i, j] + b * value[e, i, j + 1]
    upper = (1.0 - b) * value[e, i + 1, j] + b * value[e, i + 1, j + 1]
    return float((1.0 - a) * lower + a * upper)


@compiled
def gradient(value: Floats, e: int, row: float, column: float) -> tuple[float, float]:
    """Slopes per cell: differences over +-1 cell, one-sided at the edges."""
    low, high = max(row - 1.0, 0.0), min(row + 1.0, value.shape[1] - 1.0)
    rise = interpolate(value, e, high, column) - interpolate(value, e, low, column)
    left, right = max(column - 1.0, 0.0), min(column + 1.0, value.shape[2] - 1.0)
    run = interpolate(value, e, row, right) - interpolate(value, e, row, left)
    return rise / (high - low), run / (right - left)


# the Bellman step


@inlined
def grid_power_w(step: Step, u: int) -> float:
    """Engine power number u = 0..power_count-1 over the allowed range."""
    share = u / (step.power_count - 1.0)
    return step.power_low_w + share * (step.power_high_w - step.power_low_w)


@inlined
def state_at(maps: Maps, constants: Constants, soc: float, t_cl: float, speed_mps: float) -> State:
    """Gather what all commands at one state share."""
    return State(
        soc,
        t_cl,
        battery_at(maps, soc),
        alpha(constants, t_cl),
        losses_w(constants, t_cl, speed_mps),
    )


@compiled
def grid_hot_fuel_g(maps: Maps, step: Step) -> Floats:
    """`hot_fuel_g` of all `grid_power_w`."""
    hot_g = np.empty(step.power_count)
    for u in range(step.power_count):
        hot_g[u] = hot_fuel_g(maps, grid_power_w(step, u))
    return hot_g


@inlined
def command_cost(
    constants: Constants,
    step: Step,
    state: State,
    start_g: float,
    on: bool,
    power: float,
    hot_g: float,
    following: Floats,
    target: Lattice,
    strict: bool,
) -> float:
    """Fuel of one command plus W_{k+1} where it leads; `hot_g` is `hot_fuel_g` of its power.

    Leaving limits or grid costs infinity if `strict`. Else each unit beyond a limit costs
    LIMIT_FACTOR times the fuel that would make up for it, and each unit beyond the grid
    EDGE_FACTOR times. More charge than the grid holds is given away: charge never harms.
    """
    states, rows, columns = following.shape
    fuel = state.alpha * hot_g + start_g if on else 0.0
    t_end = next_t_cl(constants, state.t_cl, fuel, power, state.losses_w)
    soc_end = next_soc_of(constants, state.soc, state.battery, step.demand_w, power)
    row = (soc_end - target.soc_origin) / target.soc_spacing
    column = (t_end - target.t_cl_origin) / target.t_cl_spacing
    if strict:
        if (
            outside(row, rows)
            or outside(column, columns)
            or not constants.soc_min + MARGIN <= soc_end <= constants.soc_max + ROUNDING
            or not constants.t_cl_min_degc + MARGIN <= t_end <= constants.t_cl_max_degc - MARGIN
        ):
            return INF
        penalty = 0.0
    else:
        least_soc = max(step.coast_soc, constants.soc_min) if step.last else constants.soc_min
        soc_excess = max(least_soc - soc_end, soc_end - constants.soc_max, 0.0)
        t_excess = max(constants.t_cl_min_degc - t_end, t_end - constants.t_cl_max_degc, 0.0)
        t_beyond = abs(t_end - target.t_cl_origin - on_axis(column, columns) * target.t_cl_spacing)
        soc_below = max(target.soc_origin - soc_end, 0.0)
        penalty = constants.soc_worth_g * (LIMIT_FACTOR * soc_excess + EDGE_FACTOR * soc_below)
        penalty += constants.t_cl_worth_g_per_k * (LIMIT_FACTOR * t_excess + EDGE_FACTOR * t_beyond)
    if step.last:
        return fuel + penalty
    after = 1 if on and states == 2 else 0
    return fuel + penalty + interpolate(following, after, row, column)


@compiled
def least_penalised(
    constants: Constants,
    step: Step,
    state: State,
    start_g: float,
    hot_g: Floats,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float]:
    """Return cost, on or off, and power of the command that leaves the grid by the least.

    `hot_g` is `grid_hot_fuel_g`.
    """
    best, best_on, best_power = INF, False, 0.0
    if step.off_allowed:
        best = command_cost(
            constants, step, state, start_g, False, 0.0, 0.0, following, target, False
        )
    if step.on_allowed:
        for u in range(step.power_count):
            power = grid_power_w(step, u)
            cost = command_cost(
                constants, step, state, start_g, True, power, hot_g[u], following, target, False
            )
            if cost < best:
                best, best_on, best_power = cost, True, power
    return best, best_on, best_power


@compiled
def temperature_tables(
    maps: Maps,
    constants: Constants,
    step: Step,
    t_axis: Floats,
    target: Lattice,
    columns: int,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    run_end: Cells,
) -> None:
    """Fill fuel and next T, as cell and weight, for all engine states e, inputs u, temperatures j.

    Input u = 0 is off, u >= 1 power u - 1 of `grid_power_w`. Shapes (2 or 1, count+1, nt); fuel
    is infinite where the next T leaves the grid of `columns` nodes. Two engine states exist only
    with a start cost: e = 0, off before, and e = 1, on before. From each j on, the cells up to
    `run_end` follow one another, and all are on the grid or all off it.
    """
    states, nt = fuel.shape[0], len(t_axis)
    factor, losses = np.empty(nt), np.empty(nt)
    for j in range(nt):
        factor[j] = alpha(constants, t_axis[j])
        losses[j] = losses_w(constants, t_axis[j], step.speed_mps)
    for u in range(step.power_count + 1):
        power = grid_power_w(step, u - 1) if u > 0 else 0.0
        hot = hot_fuel_g(maps, power) if u > 0 else 0.0
        for e in range(states):
            start_g = constants.start_fuel_g if u > 0 and states == 2 and e == 0 else 0.0
            for j in range(nt):
                used = factor[j] * hot + start_g
                end = next_t_cl(constants, t_axis[j], used, power, losses[j])
                position = (end - target.t_cl_origin) / target.t_cl_spacing
                fuel[e, u, j] = INF if outside(position, columns) else used
                column[e, u, j], weight[e, u, j] = cell(position, columns)
            run_end[e, u, nt - 1] = nt
            for j in range(nt - 2, -1, -1):
                follows = column[e, u, j + 1] == column[e, u, j] + 1
                same = (fuel[e, u, j] == INF) == (fuel[e, u, j + 1] == INF)
                run_end[e, u, j] = run_end[e, u, j + 1] if follows and same else j + 1


@compiled
def improve(
    value: Floats,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    run_end: Cells,
    following: Floats,
    begin: int,
    lower: NDArray[np.int64],
    share: Floats,
    u: int,
) -> None:
    """Take the minimum with input u: value_ij = min(value_ij, fuel_j + row_i at c_j + w_j).

    row_i = (1 - s_i) W_{k+1} at lower_i + s_i W_{k+1} at lower_i + 1, for i = begin.. as far as
    `lower` goes; a negative lower_i leaves the row out. Run by run, where row_i is read in order:
    several nodes then take one instruction. Unsigned indices, as negative ones need a look.
    """
    after = np.uint64(1 if u > 0 and following.shape[0] == 2 else 0)
    v, nodes = np.uint64(u), np.uint64(value.shape[2])
    for row in range(len(lower)):
        if lower[row] < 0:
            continue
        i, low, part = np.uint64(begin + row), np.uint64(lower[row]), share[row]
        high, rest = low + ONE, 1.0 - part
        for state in range(value.shape[0]):
            e = np.uint64(state)
            start = np.uint64(0)
            while start < nodes:
                stop = np.uint64(run_end[e, v, start])
                if fuel[e, v, start] < INF:
                    first = np.uint64(column[e, v, start])
                    for n in range(stop - start):
                        j, c = start + n, first + n
                        left = rest * following[after, low, c] + part * following[after, high, c]
                        c += ONE
                        right = rest * following[after, low, c] + part * following[after, high, c]
                        cost = fuel[e, v, j] + left + weight[e, v, j] * (right - left)
                        value[e, i, j] = cost if cost < value[e, i, j] else value[e, i, j]
                start = stop


@compiled
def bellman_rows(
    first: int,
    stop: int,
    maps: Maps,
    constants: Constants,
    step: Step,
    soc_axis: Floats,
    t_axis: Floats,
    target: Lattice,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    run_end: Cells,
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
    battery = [battery_at(maps, soc_axis[i]) for i in range(first, stop)]
    lower, share = np.empty(BLOCK, dtype=np.int64), np.empty(BLOCK)
    for begin in range(first, stop, BLOCK):
        end = min(begin + BLOCK, stop)
        value[:, begin:end, :] = INF
        for u in range(0 if step.last else step.power_count + 1):
            if not (step.on_allowed if u > 0 else step.off_allowed):
                continue
            power = grid_power_w(step, u - 1) if u > 0 else 0.0
            for i in range(begin, end):
                soc = next_soc_of(constants, soc_axis[i], battery[i - first], step.demand_w, power)
                position = (soc - target.soc_origin) / target.soc_spacing
                lower[i - begin], share[i - begin] = cell(position, rows)
                if outside(position, rows):
                    lower[i - begin] = -1
            count = end - begin
            improve(
                value, fuel, column, weight, run_end, following,
                begin, lower[:count], share[:count], u,
            )  # fmt: skip
    hot_g = grid_hot_fuel_g(maps, step)
    for j in range(columns):
        factor = alpha(constants, t_axis[j])
        losses = losses_w(constants, t_axis[j], step.speed_mps)
        for i in range(first, stop):
            state = State(soc_axis[i], t_axis[j], battery[i - first], factor, losses)
            for e in range(states):
                start_g = constants.start_fuel_g if states == 2 and e == 0 else 0.0
                if step.coast_soc < INF:
                    cost, _ = landing(maps, constants, step, state, start_g)
                    value[e, i, j] = min(value[e, i, j], cost)
                if value[e, i, j] == INF:
                    value[e, i, j], _, _ = least_penalised(
                        constants, step, state, start_g, hot_g, following, target
                    )


@compiled
def best_command(
    maps: Maps,
    constants: Constants,
    step: Step,
    soc: float,
    t_cl: float,
    engine_on: bool,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float, bool]:
    """Minimise the right-hand side of the Bellman step at any state, over continuous power.

    Returns
    -------
    cost, on or off, power, and whether the command is admissible
    """
    start_g = 0.0 if engine_on else constants.start_fuel_g
    state = state_at(maps, constants, soc, t_cl, step.speed_mps)
    best, best_on, best_power = INF, False, 0.0
    if step.off_allowed and not step.last:
        best = command_cost(
            constants, step, state, start_g, False, 0.0, 0.0, following, target, True
        )
    if step.on_allowed and not step.last:
        spacing = (step.power_high_w - step.power_low_w) / (step.power_count - 1.0)
        on_best, centre, points = INF, step.power_low_w, step.power_count - 1
        for _ in range(REFINEMENTS + 1):
            around = centre
            for u in range(-points, points + 1):
                power = min(max(around + u * spacing, step.power_low_w), step.power_high_w)
                hot = hot_fuel_g(maps, power)
                cost = command_cost(
                    constants, step, state, start_g, True, power, hot, following, target, True
                )
                if cost < on_best:
                    on_best, centre = cost, power
            points = REFINEMENT_POINTS
            spacing /= points
        if on_best < best:
            best, best_on, best_power = on_best, True, centre
    cost, power = landing(maps, constants, step, state, start_g)
    if cost < best:
        best, best_on, best_power = cost, True, power
    if best < INF:
        return best, best_on, best_power, True
    hot_g = grid_hot_fuel_g(maps, step)
    best, best_on, best_power = least_penalised(
        constants, step, state, start_g, hot_g, following, target
    )
    return best, best_on, best_power, False
