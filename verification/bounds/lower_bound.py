"""A lower bound on the fuel of a whole trip that holds for every controller on the plant.

With W(SOC) = C_bat times the integral of U_oc, the energy in the battery, every run that keeps
the limits and every price lam >= 0 of energy satisfy

    fuel + lam (W_0 - W_n) >= L(lam) = min sum_k h [ alpha(T_k) f(p_k) + lam G(P_k) ] + starts

over all engine commands, with the coolant's dynamics kept and those of SOC left to its price
(Lagrangian relaxation). Where SOC_n is at least the SOC to arrive with, whose energy is W_end, the
left side is at most fuel + lam (W_0 - W_end), so that L - lam (W_0 - W_end) is a lower bound on the
fuel. `lower_bound` maximises it over lam. No convexity is assumed, nothing linearised.
A start burns its fuel, whose heat goes where that of other fuel goes, and its cranking adds to the
terminal power P of that second. Where the car is too fast for it the engine is not off. The ramp of
the engine and its shortest runs and rests are left out: they only forbid.

L(lam) is computed by dynamic programming over the coolant temperature and, where starts cost
something, whether the engine runs; all its approximations err on the low side:

- G(P) is the least internal power over soc_min..soc_max, less U' h I^2 / (2 C_bat), because the
  plant takes U_oc at the start of its explicit step
- the radiator is left out, and a full battery and engine off at full demand cost nothing; the
  cabin takes its least heat. A warmer coolant never costs more, so heat may be
  thrown away, and heat beyond T_max is
- T_min may be undercut by one grid cell, at the price of heat at the edge
- between the grid points in T and p the value is interpolated, and the most that this can be too
  high is subtracted, action by action: a quarter of the convex kink of the value that lies in the
  cell's image, the sag of alpha between temperatures and those of f and G between powers.
  Other curvature only makes interpolation too low: the coolant's step rises with T, by less than
  T, and is convex in it, as alpha is.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.vehicle.must_run import SPEED_ROUNDING_MPS
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.verification.dynamic_programming.compiled import compiled
from qpmpc.verification.independent.equations import Equations

Floats = NDArray[np.float64]

T_STEP_K = 0.1
POWER_STEP_W = 250.0
FINE_W = 25.0  # spacing at which f and G are sampled; divides the spacing of the fuel table
SOC_POINTS = 401
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
FIRST_EFFICIENCY, LAST_EFFICIENCY = 0.25, 0.65  # of turning fuel into battery energy: lam's range
PRICE_SEARCHES = 9


@dataclass(frozen=True)
class LowerBound:
    """Bound of one trip.

    Attributes
    ----------
    fuel_g : L - lam (W_0 - W_end); fuel + lam (W_end - W_n) of any run is at least this
    price_g_per_j : lam
    numerical_g : amount subtracted for interpolation; with a finer grid the bound would rise by
        about this
    """

    fuel_g: float
    price_g_per_j: float
    numerical_g: float


class _Tables(NamedTuple):
    """Data of the recursion; the first power means the engine off."""

    internal_w: Floats  # (2, steps, powers), infinite where not allowed; the second of a start
    ua_w_per_k: Floats  # (steps,)
    fuel_g_per_s: Floats  # (powers,)
    power_w: Floats  # (powers,)
    alpha: Floats  # (temperatures,)
    t_degc: Floats  # (temperatures,)
    alpha_sag: float
    fuel_sag_g_per_s: Floats  # (powers,)
    internal_sag_w: Floats  # (2, steps, powers)
    kink_share: float
    heat_k_per_g: float  # (1 - x) LHV / C
    k_per_j: float  # 1 / C
    work_share: float  # 1 - x
    t_amb_degc: float
    cabin_w: float
    start_fuel_g: float
    states: int  # 2 where starts cost something: engine off, engine on


def lower_bound(cycle: Cycle, vehicle: Vehicle) -> LowerBound:
    """Compute max_lam L(lam) - lam (W_0 - W_end), a lower bound on fuel; see the module.

    Parameters
    ----------
    cycle : the cycle driven
    vehicle : the plant; the run starts and ends as `vehicle.trip` says and keeps the limits of
        SOC, coolant, engine and battery

    Raises
    ------
    InputError
        If the trip starts outside the coolant limits, which the bound assumes to be kept.
    """
    th, start = vehicle.thermal, vehicle.trip.t_cl_init_degc
    if not th.t_cl_min_degc <= start <= th.t_cl_max_degc:
        raise InputError(
            f"vehicle {vehicle.name}: trip.t_cl_init_degc: the lower bound on fuel needs it within "
            f"{th.t_cl_min_degc:g} .. {th.t_cl_max_degc:g} (given: {start:g})"
        )
    tables = _tables(cycle, vehicle)
    lhv = vehicle.engine.lhv_j_per_kg * 1e-3
    trip = vehicle.trip
    low, high = 1.0 / (LAST_EFFICIENCY * lhv), 1.0 / (FIRST_EFFICIENCY * lhv)
    given_j = stored_energy_j(vehicle, trip.soc_init) - stored_energy_j(vehicle, trip.soc_target)
    if given_j > 0.0:
        low = 0.0  # with enough of it more is worth nothing

    def bound(price: float, strict: float = 1.0) -> float:
        value = _sweep(tables, price, strict)[0]  # from an engine that is off
        # the value falls with T: the grid point above the start is a lower bound at it
        node = int(np.searchsorted(tables.t_degc, start - 1e-9))
        return float(value[min(node, len(value) - 1)]) - price * given_j

    # concave in lam: golden section
    inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)]
    found = [bound(inner[0]), bound(inner[1])]
    for _ in range(PRICE_SEARCHES):
        if found[0] < found[1]:
            low = inner[0]
            inner = [inner[1], low + GOLDEN * (high - low)]
            found = [found[1], bound(inner[1])]
        else:
            high = inner[1]
            inner = [high - GOLDEN * (high - low), inner[0]]
            found = [bound(inner[0]), found[0]]
    best = int(found[1] > found[0])
    return LowerBound(found[best], inner[best], bound(inner[best], 0.0) - found[best])


def stored_energy_j(vehicle: Vehicle, soc: float) -> float:
    """W(SOC) = C_bat int U_oc dSOC from soc_min, exact for the tabulated U_oc."""
    battery = vehicle.battery
    between = [s for s in battery.soc_grid if min(battery.soc_min, soc) < s < max(0.0, soc)]
    grid = np.array(sorted({battery.soc_min, *between, soc}))
    voltage = Equations(vehicle).voltage_v(grid)
    energy = float(np.sum(0.5 * (voltage[1:] + voltage[:-1]) * np.diff(grid)))
    return 3600.0 * battery.capacity_ah * (energy if soc >= battery.soc_min else -energy)


def _tables(cycle: Cycle, vehicle: Vehicle) -> _Tables:
    equations = Equations(vehicle)
    engine, th = vehicle.engine, vehicle.thermal
    count = int(np.ceil((th.t_cl_max_degc - th.t_cl_min_degc) / T_STEP_K))
    temperature = np.linspace(th.t_cl_min_degc, th.t_cl_max_degc, count + 1)
    alpha = equations.alpha(temperature)
    middle = equations.alpha(0.5 * (temperature[1:] + temperature[:-1]))
    # a chord of a convex curve is nowhere further above it than twice the gap in its middle
    alpha_sag = 2.0 * float(np.max(0.5 * (alpha[1:] + alpha[:-1]) - middle))

    on = np.linspace(0.0, engine.power_max_w, int(np.ceil(engine.power_max_w / POWER_STEP_W)) + 1)
    on = np.unique(np.maximum(on, engine.power_min_w))
    fine = np.arange(engine.power_min_w, engine.power_max_w + FINE_W, FINE_W)
    fine = np.minimum(fine, engine.power_max_w)
    fuel_on = equations.fuel_g_per_s(on)
    bend = np.abs(np.interp(fine, on, fuel_on) - equations.fuel_g_per_s(fine))
    near = np.abs(fine[None, :] - on[:, None]) <= POWER_STEP_W
    fuel_sag = np.concatenate([[0.0], np.where(near, bend, 0.0).max(axis=1)])
    power, fuel = np.concatenate([[0.0], on]), np.concatenate([[0.0], fuel_on])

    least_w, most_w = -equations.charge_max_w, equations.discharge_max_w
    samples = np.arange(least_w, most_w + 2.0 * FINE_W, FINE_W)
    internal = _least_internal_w(vehicle, samples)
    asked = equations.net_w(cycle)[:, None] - power
    asked = np.stack([asked, asked + engine.start_energy_j])  # within the second of a start
    # With too little engine power the battery cannot drive: not allowed, except at the last
    # power before the least that suffices.
    allowed = asked <= most_w + POWER_STEP_W * (np.arange(len(power)) > 0)
    allowed[1, :, 0] = False  # a start with the engine off
    speed_mps = 0.5 * (cycle.speed_mps[1:] + cycle.speed_mps[:-1])
    allowed[:, speed_mps > engine.electric_max_mps + 2.0 * SPEED_ROUNDING_MPS, 0] = False
    terminal = np.clip(asked, least_w, most_w)
    internal_sag = np.interp(terminal, samples, _internal_sag_w(internal))
    # where the brakes take over, G stops falling: a kink that a chord may cut off
    internal_sag += np.where(np.abs(asked - least_w) <= POWER_STEP_W, 0.25 * POWER_STEP_W, 0.0)
    internal_sag[:, :, 0] = np.max(np.abs(np.diff(internal, 2)))  # off: no chord between powers
    g = np.interp(terminal, samples, internal)
    ua = equations.ua_w_per_k(speed_mps)
    k_per_j = 1.0 / th.heat_capacity_j_per_k
    share = 1.0 - th.exhaust_share
    heat = share * equations.lhv_j_per_g * k_per_j
    steepest = float(np.max(np.diff(fuel_on) / np.diff(on)))
    reach_k = POWER_STEP_W * max(heat * alpha.max() * steepest, share * k_per_j)
    return _Tables(
        internal_w=np.where(allowed, g, np.inf),
        ua_w_per_k=ua,
        fuel_g_per_s=fuel,
        power_w=power,
        alpha=alpha,
        t_degc=temperature,
        alpha_sag=alpha_sag,
        fuel_sag_g_per_s=fuel_sag,
        internal_sag_w=internal_sag,
        kink_share=0.25 * (1.0 + reach_k / T_STEP_K),
        heat_k_per_g=heat,
        k_per_j=k_per_j,
        work_share=share,
        t_amb_degc=th.t_amb_degc,
        cabin_w=float(equations.cabin_w(temperature).min()),
        start_fuel_g=engine.start_fuel_g,
        states=2 if engine.start_fuel_g > 0.0 or engine.start_energy_j > 0.0 else 1,
    )


def _least_internal_w(vehicle: Vehicle, power_w: Floats) -> Floats:
    """Least energy per second that leaves the store at a terminal power, over the SOC range."""
    equations, battery = Equations(vehicle), vehicle.battery
    soc = np.linspace(battery.soc_min, battery.soc_max, SOC_POINTS)
    soc = np.union1d(soc, [s for s in battery.soc_grid if soc[0] < s < soc[-1]])
    internal = equations.internal_w(soc[:, None], power_w[None, :])
    current = internal / equations.voltage_v(soc)[:, None]
    steepest = max(float(np.max(np.diff(equations.voltage_v(soc)) / np.diff(soc))), 0.0)
    least = internal - steepest * current**2 / (2.0 * equations.charge_c)
    # between SOC samples G varies by less than between neighbours
    return np.asarray(least.min(axis=0) - np.abs(np.diff(least, axis=0)).max(axis=0))


def _internal_sag_w(internal_w: Floats) -> Floats:
    """Most that chords of G, over power steps and between samples, can be above it; as samples.

    A chord of width d is above a curve by at most d^2/8 times its largest curvature nearby, which
    is the second difference at the samples' spacing, and a kink by at most d/4 times the bend.
    """
    width = round(POWER_STEP_W / FINE_W)
    second = np.zeros_like(internal_w)
    second[1:-1] = np.abs(np.diff(internal_w, 2))
    padded = np.pad(second, width, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1)
    # d^2/8 f'' = width^2/8 second; the sum bounds both smooth parts and kinks
    return np.asarray(windows.sum(axis=1) * width / 4.0 + second.max() / 8.0)


@compiled
def _sweep(tables: _Tables, price: float, strict: float) -> Floats:
    """Value (states, temperatures) at departure; `strict` 1 subtracts all interpolation errors.

    With 0 it subtracts none. States: engine off, and with starts that cost something, engine on.
    """
    temperature, alpha = tables.t_degc, tables.alpha
    _, steps, powers = tables.internal_w.shape
    points, states = len(temperature), tables.states
    t_low, cell = temperature[0], temperature[1] - temperature[0]
    value, following = np.zeros((states, points)), np.zeros((states, points))
    worst = np.zeros((states, points))
    alpha_sag_g = tables.fuel_g_per_s[powers - 1] * tables.alpha_sag
    for k in range(steps - 1, -1, -1):
        slope = 0.0
        for e in range(states):
            slope = max(slope, _bends(following[e], cell, worst[e]))
        bend = alpha[0] * (1.0 + slope * tables.heat_k_per_g)
        fixed = strict * alpha_sag_g
        for e in range(states):
            for i in range(points):
                lost_w = tables.ua_w_per_k[k] * (temperature[i] - tables.t_amb_degc)
                cool = temperature[i] - tables.k_per_j * (lost_w + tables.cabin_w)
                best = np.inf
                for j in range(powers):
                    now = 1 if j > 0 and states == 2 else 0  # the state that follows
                    start = 1 if now > e else 0
                    internal = tables.internal_w[start, k, j]
                    if internal == np.inf:
                        continue
                    fuel_g = alpha[i] * tables.fuel_g_per_s[j] + start * tables.start_fuel_g
                    work_k = tables.k_per_j * tables.work_share * tables.power_w[j]
                    place = (cool + tables.heat_k_per_g * fuel_g - work_k - t_low) / cell
                    if place < -1.0:
                        continue
                    place = min(place, points - 1.0)
                    node = min(max(int(np.floor(place)), 0), points - 2)
                    low = following[now, node]
                    along = (place - node) * (following[now, node + 1] - low)
                    cost_g = fuel_g + price * internal + low + along
                    sag_g = price * tables.internal_sag_w[start, k, j]
                    sag_g += bend * tables.fuel_sag_g_per_s[j]
                    kink_g = tables.kink_share * worst[now, node]
                    best = min(best, cost_g - strict * (sag_g + kink_g))
                value[e, i] = best - fixed
            for i in range(1, points):
                value[e, i] = min(value[e, i], value[e, i - 1])
        for e in range(states):
            for i in range(points):
                following[e, i] = value[e, i]
    return value


@compiled
def _bends(following: Floats, cell: float, worst: Floats) -> float:
    """Steepest fall of the value; `worst`: its largest convex kink near each cell."""
    points, slope = len(following), 0.0
    kink = np.zeros(points)
    for i in range(points - 1):
        slope = max(slope, (following[i] - following[i + 1]) / cell)
    for i in range(1, points - 1):
        kink[i] = max(following[i + 1] - 2.0 * following[i] + following[i - 1], 0.0)
    kink[points - 1] = following[points - 2] - following[points - 1]  # flat beyond T_max
    for i in range(points):
        worst[i] = 0.0
        for j in range(max(i - 1, 0), min(i + 3, points)):
            worst[i] = max(worst[i], kink[j])
    return slope
