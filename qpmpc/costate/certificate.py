"""A proven lower bound on the stage program at any costates, and what a plan costs in it.

Weak duality: for any multipliers of the right sign the least of the Lagrangian is no more than the
least cost of a plan. The Lagrangian is a sum over the stages, so its least is exact, with the
engine on or off in each of them, on the true curves. Three conditions: nu follows from the
recursion (`coolant_costate`), lambda is not negative, because charge may be thrown away, and a
plan's own violations are priced above the largest multiplier.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.dual import Multipliers, StageCosts, constant_part, coolant
from qpmpc.costate.path import Path, Shortest, blocks_least, shortest_path
from qpmpc.costate.program import Program
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Stages

Floats = NDArray[np.float64]

ABOVE_MULTIPLIERS = 2.0  # price of a plan's violations, relative to the largest of them


@dataclass(frozen=True)
class Layout:
    """Which stages are seconds ahead, and what binds them.

    Attributes
    ----------
    seconds : stages of 1 s that are driven
    short : N, of which the first `seconds` are
    classes : stages of a block
    shortest : run and rest
    on_for_s : how long the engine has been on or off
    arrives : whether the trip ends after the last second
    """

    seconds: int
    short: int
    classes: int
    shortest: Shortest
    on_for_s: int
    arrives: bool

    @classmethod
    def of(
        cls, stages: Stages, horizon: HorizonSettings, shortest: Shortest, on_for_s: int
    ) -> "Layout":
        """Return the layout of these stages."""
        short = horizon.short_stages
        seconds, arrival_s = len(stages.seconds_w(short)), stages.arrival_s(short)
        return cls(seconds, short, horizon.classes, shortest, on_for_s, arrival_s is not None)


@dataclass(frozen=True)
class Choice:
    """The least of the Lagrangian: on or off in the seconds ahead, and the bound that it is.

    Attributes
    ----------
    path : of the seconds ahead
    bound_g : no plan costs less
    """

    path: Path
    bound_g: float


def choose(program: Program, at: Multipliers, costs: StageCosts, layout: Layout) -> Choice:
    """Minimise the Lagrangian exactly, on or off in each stage."""
    p, n, short = program, layout.seconds, layout.short
    path = shortest_path(
        costs.on_cost[:n].tolist(),
        costs.off_cost[:n].tolist(),
        costs.start_cost[:n].tolist(),
        layout.shortest,
        p.starts_on,
        layout.on_for_s,
        layout.arrives,
    )
    blocks = blocks_least(
        costs.on_cost[short:],
        costs.off_cost[short:],
        costs.start_cost[short:],
        p.rises[short:],
        layout.classes,
    )
    blocks += float(costs.forced_cost[short:].sum())
    return Choice(path, path.cost + blocks + constant_part(p, at, costs.nu))


@dataclass(frozen=True)
class Followed:
    """A plan in the program; shape (n,) each.

    Attributes
    ----------
    on_share : of the whole stage, forced + free sigma
    power_w, fuel_g_per_s, internal_w : means of E, F and internal power over the whole stage
    starts : u
    soc, t_cl_degc : at the end of each stage; what does not fit under the upper limit of SOC is
        thrown away
    cost_g : fuel as expanded, starts, slack, and SOC below its limits at `soc_price`
    """

    on_share: Floats
    power_w: Floats
    fuel_g_per_s: Floats
    internal_w: Floats
    starts: Floats
    soc: Floats
    t_cl_degc: Floats
    cost_g: float


def violation_price_g(at: Multipliers) -> float:
    """Price of SOC below its limits that is above every multiplier of these, g per unit."""
    return ABOVE_MULTIPLIERS * float(at.charge.max())


def follow(
    program: Program,
    share: Floats,
    power_w: Floats,
    forced_power_w: Floats,
    short: int,
    soc_price: float,
) -> Followed:
    """Return where on-shares and powers lead, and what that costs.

    Parameters
    ----------
    program : of the second
    share, power_w, forced_power_w : sigma, and E while on, where there is a choice and where there
        is none, shape (n,)
    short : N, stages of a second, which do not share their time between two powers
    soc_price : of SOC below its limits, g; at least the largest multiplier of a limit
    """
    p, of_choice = program, program.free * share
    fuel = p.shared.fuel_g_per_s(power_w)
    fuel[:short] = p.curves.fuel_g_per_s(power_w[:short])
    fuel = of_choice * fuel + p.forced * p.shared.fuel_g_per_s(forced_power_w)
    power = of_choice * power_w + p.forced * forced_power_w
    internal = of_choice * p.curves.internal_w(p.net_w - power_w)
    internal += p.forced * p.curves.internal_w(p.forced_net_w - forced_power_w)
    rise = np.diff(share, prepend=float(p.starts_on))
    starts = np.maximum(p.rises * rise, 0.0) if p.has_start else np.zeros_like(share)
    internal += p.free * (1.0 - share) * p.off_w
    soc, socs = p.soc, []
    spent = (p.charge_per_w * internal + p.cranking_soc * starts).tolist()
    for k, most in enumerate(p.soc_high.tolist()):
        soc = min(soc - spent[k], most)
        socs.append(soc)
    heat = p.per_fuel * fuel - p.per_power * power + p.start_k * starts
    t_cl = coolant(p, heat)
    beyond_k = np.maximum(p.t_low - t_cl, 0.0) + np.maximum(t_cl - p.t_high, 0.0)
    cost = float((p.fuel_cost * fuel + p.price_t * t_cl).sum())
    cost += p.start_fuel_g * float(starts.sum()) + p.slack_g_per_k * float(beyond_k.sum())
    end = np.array(socs)
    cost += soc_price * float(np.maximum(p.soc_low - end, 0.0).sum())
    return Followed(p.forced + of_choice, power, fuel, internal, starts, end, t_cl, cost)
