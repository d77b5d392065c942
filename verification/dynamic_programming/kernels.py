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
Ints = NDArray[np.int64]
Cells = NDArray[np.uint32]
Battery = tuple[float, float, float]  # open-circuit voltage, resistances of discharge and charge

INF = np.inf
ONE = np.uint64(1)
EDGE = 1e-9  # tolerance at the edge of a grid, in cells
MARGIN = 1e-9  # kept from the limits, so that rounding cannot cross them
ROUNDING = 1e-14  # at SOC_max, where the brakes hold the battery exactly
LIMIT_FACTOR = 30.0  # see command_cost
EDGE_FACTOR = 2.0
DWELL_G = 30.0  # for a shortest run or rest that is broken; see least_penalised
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
    start_energy_j: float
    soc_worth_g: float
    t_cl_worth_g_per_k: float
    energy_worth_g_per_j: float


class LatticeAxis(NamedTuple):
    """One axis of a grid at one time; see `grid.Axis`."""

    low: float
    spacing: float
    cells: int
    phase: float
    offset: int


class Lattice(NamedTuple):
    """Where a grid lies at one time."""

    soc: LatticeAxis
    t_cl: LatticeAxis


class Powers(NamedTuple):
    """Engine powers that a second allows: of an engine that starts in it, or of one that ran."""

    is_start: bool
    allowed: bool
    low_w: float
    high_w: float


class Step(NamedTuple):
    """What one second asks for, and which engine powers are allowed.

    `coast_*` are the least SOC and T at its end from which the rest is driven with the engine off,
    infinite where there are none.
    """

    demand_w: float
    speed_mps: float
    running: Powers
    starting: Powers
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
    fill the battery beyond SOC_max. `battery` is `battery_at` this SOC. Of a starting engine
    `power_w` is what is left of its power beside its cranking.
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
    """Power beside cranking with which the step ends at `soc_end`, the inverse of `soc_after`.

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
def drift(
    maps: Maps,
    constants: Constants,
    demand_w: Floats,
    speed_mps: Floats,
    soc: Floats,
    t_cl: Floats,
) -> tuple[Floats, Floats]:
    """Sum of what SOC and T lose or gain in a second off at given states, shapes (n+1,)."""
    n = len(demand_w)
    soc_sum, t_cl_sum = np.zeros(n + 1), np.zeros(n + 1)
    for k in range(n):
        p, v = demand_w[k], speed_mps[k]
        soc_sum[k + 1] = soc_sum[k] + next_soc(maps, constants, soc[k], p, 0.0) - soc[k]
        losses = losses_w(constants, t_cl[k], v)
        t_cl_sum[k + 1] = t_cl_sum[k] + next_t_cl(constants, t_cl[k], 0.0, 0.0, losses) - t_cl[k]
    return soc_sum, t_cl_sum


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


@inlined
def costs_of_start(constants: Constants, is_start: bool) -> tuple[float, float]:
    """Fuel g of a start, and power W that cranks the engine in its second; else zero."""
    if is_start:
        return constants.start_fuel_g, constants.start_energy_j
    return 0.0, 0.0


@compiled
def landing(
    maps: Maps, constants: Constants, step: Step, state: State, powers: Powers
) -> tuple[float, float]:
    """Return fuel and power of the least costly running engine into the coasting set.

    min alpha f(P) + start such that SOC' >= SOC* and T' >= T*. Fuel and both states grow with P,
    so the least admissible P does it. Infinite fuel if there is none.
    """
    nothing = (INF, 0.0)
    if not powers.allowed or step.coast_soc == INF:
        return nothing
    start_g, cranking_w = costs_of_start(constants, powers.is_start)
    power = max(
        power_to_reach(constants, state.soc, state.battery, step.demand_w, step.coast_soc)
        + cranking_w,
        powers.low_w,
    )
    if power > powers.high_w:
        return nothing
    fuel = state.alpha * hot_fuel_g(maps, power) + start_g
    if next_t_cl(constants, state.t_cl, fuel, power, state.losses_w) < step.coast_t_cl_degc:
        low, high = power, powers.high_w
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
    after = next_soc_of(constants, state.soc, state.battery, step.demand_w, power - cranking_w)
    if not step.coast_soc - 0.1 * MARGIN <= after <= constants.soc_max + ROUNDING:
        return nothing
    return fuel, power


# interpolation


@inlined
def on_axis(position: float, points: int) -> float:
    """Clamp a position to an axis."""
    return min(max(position, 0.0), points - 1.0)


@inlined
def position_of(axis: LatticeAxis, x: float) -> float:
    """Position of x in nodes; the cells at the two limits may be narrower than the others."""
    inside = (x - axis.low) / axis.spacing
    number = inside - axis.phase + 1.0
    if number < 1.0:
        number = inside / axis.phase
    elif number > axis.cells:
        number = axis.cells + (number - axis.cells) / (1.0 - axis.phase)
    return number - axis.offset


@inlined
def node_of(axis: LatticeAxis, index: int) -> float:
    """Node number `index` of the grid."""
    number = axis.offset + index
    if number > axis.cells:
        return axis.low + axis.spacing * axis.cells
    return axis.low + axis.spacing * max(number - 1.0 + axis.phase, 0.0) * (number > 0)


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
    """Bilinear interpolation of value[e, i, j] at a position in nodes, clamped to the grid."""
    i, a = cell(row, value.shape[1])
    j, b = cell(column, value.shape[2])
    lower = (1.0 - b) * value[e, i, j] + b * value[e, i, j + 1]
    upper = (1.0 - b) * value[e, i + 1, j] + b * value[e, i + 1, j + 1]
    return float((1.0 - a) * lower + a * upper)


@compiled
def gradient(
    value: Floats, e: int, lattice: Lattice, soc: float, t_cl: float
) -> tuple[float, float]:
    """Slopes over SOC and T: differences over +-1 whole cell, one-sided at the edges."""
    rows, columns = value.shape[1], value.shape[2]
    row, column = position_of(lattice.soc, soc), position_of(lattice.t_cl, t_cl)
    low = max(soc - lattice.soc.spacing, node_of(lattice.soc, 0))
    high = min(soc + lattice.soc.spacing, node_of(lattice.soc, rows - 1))
    rise = interpolate(value, e, position_of(lattice.soc, high), column) - interpolate(
        value, e, position_of(lattice.soc, low), column
    )
    left = max(t_cl - lattice.t_cl.spacing, node_of(lattice.t_cl, 0))
    right = min(t_cl + lattice.t_cl.spacing, node_of(lattice.t_cl, columns - 1))
    run = interpolate(value, e, row, position_of(lattice.t_cl, right)) - interpolate(
        value, e, row, position_of(lattice.t_cl, left)
    )
    return rise / (high - low), run / (right - left)


# the Bellman step


class Moves(NamedTuple):
    """Where a second on or off leads each engine state, as in `engine_states.EngineStates`.

    `same` is a state with the same value function, itself for those that are computed.
    """

    rests: int
    is_start: Bools
    on_next: Ints
    off_next: Ints
    most_w: Floats
    may_end: Bools
    same: Ints


class Move(NamedTuple):
    """`Moves` of one engine state, and the engine powers of a second on."""

    powers: Powers
    most_w: float
    may_on: bool
    may_off: bool
    on_next: int
    off_next: int
    may_end: bool


@inlined
def move_of(step: Step, moves: Moves, e: int, most_w: float) -> Move:
    """Gather the moves from one engine state; those that are forbidden lead where they would."""
    return Move(
        step.starting if moves.is_start[e] else step.running,
        most_w,
        moves.on_next[e] >= 0,
        moves.off_next[e] >= 0,
        moves.on_next[e] if moves.on_next[e] >= 0 else moves.rests,
        max(moves.off_next[e], 0),
        moves.may_end[e] or step.last,
    )


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
def hot_fuels_g(maps: Maps, power_w: Floats) -> Floats:
    """`hot_fuel_g` of many powers."""
    hot_g = np.empty(len(power_w))
    for u in range(len(power_w)):
        hot_g[u] = hot_fuel_g(maps, power_w[u])
    return hot_g


@inlined
def command_cost(
    constants: Constants,
    step: Step,
    state: State,
    is_start: bool,
    on: bool,
    power: float,
    hot_g: float,
    following: Floats,
    after: int,
    target: Lattice,
    strict: bool,
) -> float:
    """Fuel of one command plus W_{k+1} where it leads; `hot_g` is `hot_fuel_g` of its power.

    Leaving limits or grid costs infinity if `strict`. Else each unit beyond a limit costs
    LIMIT_FACTOR times the fuel that would make up for it, and each unit beyond the grid
    EDGE_FACTOR times. More charge than the grid holds is given away: charge never harms.
    """
    rows, columns = following.shape[1], following.shape[2]
    start_g, cranking_w = costs_of_start(constants, is_start and on)
    fuel = state.alpha * hot_g + start_g if on else 0.0
    t_end = next_t_cl(constants, state.t_cl, fuel, power, state.losses_w)
    soc_end = next_soc_of(constants, state.soc, state.battery, step.demand_w, power - cranking_w)
    row, column = position_of(target.soc, soc_end), position_of(target.t_cl, t_end)
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
        t_below = node_of(target.t_cl, 0) - t_end
        t_beyond = max(t_below, t_end - node_of(target.t_cl, columns - 1), 0.0)
        soc_below = max(node_of(target.soc, 0) - soc_end, 0.0)
        penalty = constants.soc_worth_g * (LIMIT_FACTOR * soc_excess + EDGE_FACTOR * soc_below)
        penalty += constants.t_cl_worth_g_per_k * (LIMIT_FACTOR * t_excess + EDGE_FACTOR * t_beyond)
    if step.last:
        return fuel + penalty
    return fuel + penalty + interpolate(following, after, row, column)


@compiled
def least_penalised(
    constants: Constants,
    step: Step,
    state: State,
    move: Move,
    power_w: Floats,
    hot_g: Floats,
    ramped_hot_g: float,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float]:
    """Return cost, on or off, and power of the command that breaks limits or grid by the least.

    A shortest run or rest that is broken costs DWELL_G; power that the ramp does not allow, and
    neither can the battery give, LIMIT_FACTOR times its fuel.

    Parameters
    ----------
    power_w, hot_g : engine powers to be tried, and their `hot_fuel_g`
    ramped_hot_g : that of the greatest power that the ramp allows
    """
    best, best_on, best_power = INF, False, 0.0
    start = move.powers.is_start
    if step.off_allowed:
        best = command_cost(
            constants, step, state, start, False, 0.0, 0.0, following, move.off_next, target, False
        )
        best += 0.0 if move.may_off else DWELL_G
    if move.powers.allowed:
        broken_g = 0.0 if move.may_on else DWELL_G
        for u in range(len(power_w)):
            power = power_w[u]
            if power > move.most_w:
                break
            cost = broken_g + command_cost(
                constants, step, state, start, True, power, hot_g[u],
                following, move.on_next, target, False,
            )  # fmt: skip
            if cost < best:
                best, best_on, best_power = cost, True, power
        missing_w = move.powers.low_w - move.most_w
        if missing_w > 0.0:
            cost = command_cost(
                constants, step, state, start, True, move.most_w, ramped_hot_g,
                following, move.on_next, target, False,
            )  # fmt: skip
            cost += broken_g + LIMIT_FACTOR * constants.energy_worth_g_per_j * missing_w
            if cost < best:
                best, best_on, best_power = cost, True, move.most_w
    return best, best_on, best_power


@compiled
def temperature_tables(
    maps: Maps,
    constants: Constants,
    speed_mps: float,
    power_w: Floats,
    counts: Ints,
    t_axis: Floats,
    target: LatticeAxis,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    run_end: Cells,
) -> None:
    """Fill fuel and next T, as cell and weight, for all inputs u and temperatures j.

    First index s: 0 for an engine that ran, 1 for one that starts. Input u = 0 is off, u >= 1 on
    with power_w[s, u], up to counts[s]. Shapes (1 or 2, inputs, nt); fuel
    is infinite where the next T leaves the grid. From each j on, the cells up to
    `run_end` follow one another, and all are on the grid or all off it.
    """
    nt = len(t_axis)
    factor, losses = np.empty(nt), np.empty(nt)
    for j in range(nt):
        factor[j] = alpha(constants, t_axis[j])
        losses[j] = losses_w(constants, t_axis[j], speed_mps)
    for s in range(len(counts)):
        for u in range(s, counts[s]):
            power = power_w[s, u]
            hot = hot_fuel_g(maps, power) if u > 0 else 0.0
            start_g, _ = costs_of_start(constants, s == 1)
            for j in range(nt):
                used = factor[j] * hot + start_g
                end = next_t_cl(constants, t_axis[j], used, power, losses[j])
                position = position_of(target, end)
                fuel[s, u, j] = INF if outside(position, nt) else used
                column[s, u, j], weight[s, u, j] = cell(position, nt)
            run_end[s, u, nt - 1] = nt
            for j in range(nt - 2, -1, -1):
                follows = column[s, u, j + 1] == column[s, u, j] + 1
                same = (fuel[s, u, j] == INF) == (fuel[s, u, j + 1] == INF)
                run_end[s, u, j] = run_end[s, u, j + 1] if follows and same else j + 1


@compiled
def improve(
    value: Floats,
    e: int,
    fuel: Floats,
    column: Cells,
    weight: Floats,
    run_end: Cells,
    following: Floats,
    after: int,
    begin: int,
    lower: Ints,
    share: Floats,
    s: int,
    u: int,
) -> None:
    """Take the minimum with an input: value_ij = min(value_ij, fuel_j + row_i at c_j + w_j).

    Of engine state e, with input u of `temperature_tables` s, which leads to engine state `after`;
    row_i = (1 - s_i) W_{k+1} at lower_i + s_i W_{k+1} at lower_i + 1, for i = begin.. as far as
    `lower` goes; a negative lower_i leaves the row out. Run by run, where row_i is read in order:
    several nodes then take one instruction. Unsigned indices, as negative ones need a look.
    """
    a, d, v, w = np.uint64(e), np.uint64(after), np.uint64(u), np.uint64(s)
    nodes = np.uint64(value.shape[2])
    for row in range(len(lower)):
        if lower[row] < 0:
            continue
        i, low, part = np.uint64(begin + row), np.uint64(lower[row]), share[row]
        high, rest = low + ONE, 1.0 - part
        start = np.uint64(0)
        while start < nodes:
            stop = np.uint64(run_end[w, v, start])
            if fuel[w, v, start] < INF:
                first = np.uint64(column[w, v, start])
                for n in range(stop - start):
                    j, c = start + n, first + n
                    left = rest * following[d, low, c] + part * following[d, high, c]
                    c += ONE
                    right = rest * following[d, low, c] + part * following[d, high, c]
                    cost = fuel[w, v, j] + left + weight[w, v, j] * (right - left)
                    value[a, i, j] = cost if cost < value[a, i, j] else value[a, i, j]
            start = stop


@compiled
def bellman_rows(
    first: int,
    stop: int,
    maps: Maps,
    constants: Constants,
    step: Step,
    moves: Moves,
    power_w: Floats,
    counts: Ints,
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

    W_k(x, e) = min{ W_{k+1}(x'_off, e'_off),
                     min_P alpha f(P) + start + W_{k+1}(x'_P, e'_on),
                     min_P alpha f(P) + start   over x'_P in the coasting set of k+1 }

    over inputs that keep x' on the grid of k+1, and that engine state e allows; where none does,
    the least penalised one. `following` and `value` are W_{k+1} and W_k, shape (states, ns, nt);
    the other arrays as in `temperature_tables`.
    """
    states, rows = following.shape[0], following.shape[1]
    battery = [battery_at(maps, soc_axis[i]) for i in range(first, stop)]
    lower, share = np.empty(BLOCK, dtype=np.int64), np.empty(BLOCK)
    for begin in range(first, stop, BLOCK):
        end = min(begin + BLOCK, stop)
        count = end - begin
        value[:, begin:end, :] = INF
        for s in range(0 if step.last else len(counts)):
            _, cranking_w = costs_of_start(constants, s == 1)
            for u in range(s, counts[s]):
                if not (step.off_allowed if u == 0 else (step.running, step.starting)[s].allowed):
                    continue
                power = power_w[s, u]
                for i in range(begin, end):
                    soc = next_soc_of(
                        constants, soc_axis[i], battery[i - first], step.demand_w,
                        power - cranking_w,
                    )  # fmt: skip
                    position = position_of(target.soc, soc)
                    lower[i - begin], share[i - begin] = cell(position, rows)
                    if outside(position, rows):
                        lower[i - begin] = -1
                for e in range(states):
                    other = u > 0 and moves.is_start[e] != (s == 1)
                    after = moves.on_next[e] if u > 0 else moves.off_next[e]
                    if other or after < 0 or power > moves.most_w[e] or moves.same[e] != e:
                        continue
                    improve(
                        value, e, fuel, column, weight, run_end, following, after,
                        begin, lower[:count], share[:count], s, u,
                    )  # fmt: skip
    finish_rows(
        first, stop, maps, constants, step, moves, power_w, counts, soc_axis, t_axis, target,
        battery, following, value,
    )  # fmt: skip


@compiled
def finish_rows(
    first: int,
    stop: int,
    maps: Maps,
    constants: Constants,
    step: Step,
    moves: Moves,
    power_w: Floats,
    counts: Ints,
    soc_axis: Floats,
    t_axis: Floats,
    target: Lattice,
    battery: list[Battery],
    following: Floats,
    value: Floats,
) -> None:
    """Take landings into W_k, and penalties where nothing else is left; see `bellman_rows`."""
    rows, columns, kinds = stop - first, value.shape[2], len(counts)
    factor, losses = np.empty(columns), np.empty(columns)
    for j in range(columns):
        factor[j] = alpha(constants, t_axis[j])
        losses[j] = losses_w(constants, t_axis[j], step.speed_mps)
    landed_g, landed_w = np.full((kinds, rows, columns), INF), np.zeros((kinds, rows, columns))
    for s in range(kinds if step.coast_soc < INF else 0):
        powers = step.starting if s == 1 else step.running
        _, cranking_w = costs_of_start(constants, s == 1)
        for i in range(first, stop):
            soc, at = soc_axis[i], battery[i - first]
            least_w = power_to_reach(constants, soc, at, step.demand_w, step.coast_soc)
            if least_w + cranking_w > powers.high_w:
                continue
            for j in range(columns):
                state = State(soc, t_axis[j], at, factor[j], losses[j])
                landed_g[s, i - first, j], landed_w[s, i - first, j] = landing(
                    maps, constants, step, state, powers
                )
    hot_g = [hot_fuels_g(maps, power_w[s, 1 : counts[s]]) for s in range(kinds)]
    for e in range(value.shape[0]):
        if moves.same[e] != e:
            continue
        move, s = move_of(step, moves, e, moves.most_w[e]), 1 if moves.is_start[e] else 0
        ramped_g, lands = hot_fuel_g(maps, move.most_w), move.may_on and move.may_end
        for i in range(first, stop):
            for j in range(columns):
                if lands and landed_w[s, i - first, j] <= move.most_w:
                    value[e, i, j] = min(value[e, i, j], landed_g[s, i - first, j])
                if value[e, i, j] == INF:
                    state = State(soc_axis[i], t_axis[j], battery[i - first], factor[j], losses[j])
                    value[e, i, j], _, _ = least_penalised(
                        constants, step, state, move, power_w[s, 1 : counts[s]], hot_g[s],
                        ramped_g, following, target,
                    )  # fmt: skip
    for e in range(value.shape[0]):
        if moves.same[e] != e:
            value[e, first:stop, :] = value[moves.same[e], first:stop, :]


@compiled
def best_command(
    maps: Maps,
    constants: Constants,
    step: Step,
    moves: Moves,
    e: int,
    most_w: float,
    power_w: Floats,
    soc: float,
    t_cl: float,
    following: Floats,
    target: Lattice,
) -> tuple[float, bool, float, bool]:
    """Minimise the right-hand side of the Bellman step at any state, over continuous power.

    Parameters
    ----------
    e, most_w : engine state, and the greatest power that the ramp allows
    power_w : engine powers from which the search starts, the least and the greatest among them

    Returns
    -------
    cost, on or off, power, and whether the command is admissible
    """
    state = state_at(maps, constants, soc, t_cl, step.speed_mps)
    move = move_of(step, moves, e, most_w)
    start, powers = move.powers.is_start, move.powers
    best, best_on, best_power = INF, False, 0.0
    if step.off_allowed and move.may_off and not step.last:
        best = command_cost(
            constants, step, state, start, False, 0.0, 0.0, following, move.off_next, target, True
        )
    low_w, high_w = powers.low_w, min(powers.high_w, move.most_w)
    if powers.allowed and move.may_on and low_w <= high_w and not step.last:
        points = len(power_w) - 1
        spacing = (high_w - low_w) / points
        on_best, centre = INF, low_w
        for _ in range(REFINEMENTS + 1):
            around = centre
            for u in range(-points, points + 1):
                power = min(max(around + u * spacing, low_w), high_w)
                hot = hot_fuel_g(maps, power)
                cost = command_cost(
                    constants, step, state, start, True, power, hot,
                    following, move.on_next, target, True,
                )  # fmt: skip
                if cost < on_best:
                    on_best, centre = cost, power
            points = REFINEMENT_POINTS
            spacing /= points
        if on_best < best:
            best, best_on, best_power = on_best, True, centre
    if move.may_on and move.may_end:
        limited = Powers(start, powers.allowed, low_w, high_w)
        cost, power = landing(maps, constants, step, state, limited)
        if cost < best:
            best, best_on, best_power = cost, True, power
    if best < INF:
        return best, best_on, best_power, True
    hot_g = hot_fuels_g(maps, power_w)
    best, best_on, best_power = least_penalised(
        constants, step, state, move, power_w, hot_g, hot_fuel_g(maps, move.most_w),
        following, target,
    )  # fmt: skip
    return best, best_on, best_power, False
