"""Small stage programs, and their exact solution by a mixed-integer program."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import lil_array, vstack

from qpmpc.costate.certificate import Layout
from qpmpc.costate.path import Shortest
from qpmpc.costate.program import Program, ProgramBuilder
from qpmpc.cycles import load_cycle
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation
from qpmpc.qp.settings import LimitSettings
from qpmpc.vehicle import load_vehicle

Floats = NDArray[np.float64]

SHORT = 5
HORIZON = HorizonSettings(short_stages=SHORT, blocks=1, entry_share=0.0)
POWERS = 25  # tried in each stage
# of the part of NYCC that the programs see: a minute, so that a terminal SOC a little below or
# above that of departure can be had
SECONDS = 60


@cache
def builder(vehicle_name: str) -> tuple[StageBuilder, ProgramBuilder]:
    vehicle = load_vehicle(vehicle_name).with_settings({"thermal.t_cl_min_degc": 50.0})
    whole = Trace.of(load_cycle("nycc"), vehicle)
    part = slice(30, 30 + SECONDS)
    trace = Trace(whole.demand_w[part], whole.speed_mps[part])
    stages = StageBuilder(vehicle, trace, trace, HORIZON)
    limits = LimitSettings(t_cl_margin_k=0.0, soc_reserve=0.0, terminal_high=1.001)
    return stages, ProgramBuilder(vehicle, PwaModel.of(vehicle), stages.count, limits, HORIZON)


def program(
    vehicle: str, step: int, soc: float, t_cl_degc: float, engine_on: bool
) -> tuple[Program, Layout]:
    """The program of a second of that minute, and how it is laid out."""
    stages, programs = builder(vehicle)
    ahead = stages.at(step)
    about = Linearisation.constant(stages.count, t_cl_degc)
    made = programs.at(ahead, soc, t_cl_degc, about, engine_on)
    shortest = Shortest.of(load_vehicle(vehicle).engine)
    return made, Layout.of(ahead, HORIZON, shortest, 10)


def exact(p: Program, layout: Layout) -> tuple[float, float]:
    """Least cost of a plan with the engine on or off in each stage at one of `POWERS` powers.

    Returns
    -------
    cost of the best plan, and a bound on it (HiGHS stops before they are equal)
    """
    n = len(p.duration_s)
    # on at each power where there is a choice, and where there is none; per stage: waste, slack,
    # starts, SOC and T
    per = 2 * POWERS + 5
    size = n * per
    cost, low, high = np.zeros(size), np.zeros(size), np.full(size, np.inf)
    whole = np.zeros(size)
    rows, lower, upper = [], [], []

    def row(entries: dict[int, float], least: float, most: float) -> None:
        line = lil_array((1, size))
        for place, value in entries.items():
            line[0, place] = value
        rows.append(line)
        lower.append(least)
        upper.append(most)

    def at(k: int, j: int) -> int:
        return k * per + j

    waste, slack, start, soc, t_cl = (2 * POWERS + j for j in range(5))
    for k in range(n):
        free = np.linspace(p.low_w[k], p.high_w[k], POWERS)
        forced = np.linspace(p.forced_low_w[k], p.forced_high_w[k], POWERS)
        powers = np.concatenate([free, forced])
        nets = np.repeat([p.net_w[k], p.forced_net_w[k]], POWERS)
        parts = np.repeat([p.free[k], p.forced[k]], POWERS)
        curves = p.curves if k < layout.short else p.shared
        fuel, internal = curves.fuel_g_per_s(powers), curves.internal_w(nets - powers)
        high[k * per : k * per + 2 * POWERS] = 1.0
        whole[k * per : k * per + POWERS] = 1
        for j in range(2 * POWERS):
            cost[at(k, j)] = p.fuel_cost[k] * parts[j] * fuel[j]
        row({at(k, j): 1.0 for j in range(POWERS)}, float(p.must[k]), float(p.can[k]))
        row({at(k, POWERS + j): 1.0 for j in range(POWERS)}, 1.0, 1.0)
        cost[at(k, slack)] = p.slack_g_per_k
        cost[at(k, start)] = p.start_fuel_g
        cost[at(k, t_cl)] = p.price_t[k]
        low[at(k, soc)], high[at(k, soc)] = p.soc_low[k], p.soc_high[k]
        low[at(k, t_cl)] = -np.inf
        row({at(k, t_cl): 1.0, at(k, slack): 1.0}, p.t_low[k], np.inf)
        row({at(k, t_cl): 1.0, at(k, slack): -1.0}, -np.inf, p.t_high[k])
        c = p.charge_per_w[k]
        off = np.repeat([p.off_w[k], 0.0], POWERS)
        drawn = {at(k, j): c * parts[j] * (internal[j] - off[j]) for j in range(2 * POWERS)}
        drawn |= {at(k, soc): 1.0, at(k, waste): 1.0, at(k, start): p.cranking_soc}
        right = -c * p.free[k] * p.off_w[k]
        heat = {
            at(k, j): parts[j] * (p.per_power[k] * powers[j] - p.per_fuel[k] * fuel[j])
            for j in range(2 * POWERS)
        }
        heat |= {at(k, t_cl): p.t_end[k], at(k, start): -p.start_k[k]}
        warm = p.settled[k]
        if k:
            drawn[at(k - 1, soc)] = -1.0
            heat[at(k - 1, t_cl)] = p.t_before[k]
        else:
            right += p.soc
            warm -= p.t_before[0] * p.t_cl_degc
        row(drawn, right, right)
        row(heat, warm, warm)
        _starts(row, at, start, p, layout, k)
    found = milp(
        cost,
        integrality=whole,
        bounds=Bounds(low, high),
        constraints=LinearConstraint(vstack(rows).tocsc(), lower, upper),
        options={"mip_rel_gap": 1e-4, "time_limit": 20.0},
    )
    if found.x is None:
        return np.inf, np.inf
    return float(found.fun), float(found.mip_dual_bound)


def _starts(row, at, start, p: Program, layout: Layout, k: int) -> None:
    """u_k >= rises_k (on_k - on_k-1), and the shortest run and rest."""
    is_on = {at(k, j): 1.0 for j in range(POWERS)}
    before = {at(k - 1, j): 1.0 for j in range(POWERS)} if k else {}
    now = float(p.starts_on) if k == 0 else 0.0
    rise = p.rises[k]
    entries = {at(k, start): 1.0, **dict.fromkeys(is_on, -rise), **dict.fromkeys(before, rise)}
    row(entries, -rise * now, np.inf)
    row({at(k, start): 1.0}, 0.0, abs(rise))
    if k >= layout.seconds:
        return
    for later in range(k + 1, min(k + layout.shortest.on_s, layout.seconds)):
        then = {at(later, j): 1.0 for j in range(POWERS)}
        # on_later >= on_k - on_before
        row({**then, **dict.fromkeys(is_on, -1.0), **before}, -now, np.inf)
    for later in range(k + 1, min(k + layout.shortest.off_s, layout.seconds)):
        then = {at(later, j): 1.0 for j in range(POWERS)}
        # 1 - on_later >= on_before - on_k
        row({**then, **dict.fromkeys(is_on, -1.0), **before}, -np.inf, 1.0 - now)
    if layout.arrives and k > layout.seconds - layout.shortest.on_s:
        row({**is_on, **dict.fromkeys(before, -1.0)}, -np.inf, now)
