"""A run of the engine that goes on, where the rest of the trip wants less than one more.

The plan relaxes on and off to a share, and so gets the little that is missing at arrival by a part
of a start. On the road that is a whole one, with its fuel and its shortest run.

The same in C: codegen/runtime/mpc_last_run.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.qp.polish import Polish, Prices
from qpmpc.qp.rows import table_of
from qpmpc.vehicle.engine_parameters import Engine

LEAST_GAIN_W = 1000.0  # that the battery must gain while a run goes on, or it goes on for nothing
WANTED_LEAST = 0.5  # of a shortest run: less than that the plan would never start the engine for
FUEL_LEAST = 0.5  # g that a gram of fuel costs, its heat set off: below it the plan wants heat
MUST_LEAST_S = 1e-3  # less is rounding: no second ahead has to run


def last_run_w(
    engine: Engine,
    polish: Polish,
    prices: Prices,
    power_w: float,
    stages: Stages,
    internal_w: NDArray[np.float64],
) -> float:
    """Return the power at which a run goes on for all that the plan still wants; 0 if it need not.

    With E the least-cost power of the coming second, g = l(P0) - l(P0 - E) what the
    battery gains by it, d what that second costs more than one with the engine off, all at the
    plan's prices, and b the shortest run,

        W = sum_k h_k (l_off,k - G_k)

    is the energy that all of the plan takes from the engine. The run goes on if W is that of at
    least half a shortest run and of no more than one, b g / 2 <= W <= b g, if that costs no more
    than a start, d W / g <= c, and if no second ahead has to run anyway. Not where the plan wants
    heat: then that, not W, decides how long the engine runs. To be asked while it does.

    Parameters
    ----------
    engine : gives b and c
    polish, prices : of the plan
    power_w : E at those prices, see `Polish`
    stages : of the plan, from now on
    internal_w : G, internal battery power of each stage by the plan, shape (n,)
    """
    if not table_of(engine).has_start or stages.must_s > MUST_LEAST_S:
        return 0.0
    net_w = float(stages.net_w[0])
    gain_w = float(stages.internal_off_w[0]) - polish.internal_w(net_w - power_w)
    if gain_w < LEAST_GAIN_W or prices.fuel < FUEL_LEAST:
        return 0.0
    fuel_g_per_s = float(polish.fuel(power_w))
    dearer = prices.fuel * fuel_g_per_s + prices.p_eng * power_w - prices.internal * gain_w
    wanted_s = float((stages.duration_s * (stages.internal_off_w - internal_w)).sum()) / gain_w
    is_one_run = WANTED_LEAST * engine.min_on_s <= wanted_s <= engine.min_on_s
    return power_w if is_one_run and dearer * wanted_s <= engine.start_fuel_g else 0.0
