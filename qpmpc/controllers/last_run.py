"""The last run of the engine, of which a plan wants a part: the one before goes on, or it begins.

The plan relaxes on and off to a share, and so gets the little that is missing at arrival by a part
of a start. On the road that is a whole one, with its fuel and its shortest run. If the engine runs,
the run may go on for it. If it rests, the plan spreads the start over the seconds that suit it, a
third of one in each of ten; rounded to off, all are thrown away, and what is missing takes a start
at standstill before arrival.

The same in C: codegen/runtime/mpc_last_run.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.pwa.priced import Going
from qpmpc.qp.rows import table_of
from qpmpc.vehicle.engine_parameters import Engine

LEAST_GAIN_W = 1000.0  # that the battery must gain while a run goes on, or it goes on for nothing
WANTED_LEAST = 0.5  # of a shortest run: less than that the plan would never start the engine for
FUEL_LEAST = 0.5  # g that a gram of fuel costs, its heat set off: below it the plan wants heat
START_LEAST, START_MOST = 0.5, 1.5  # of what a shortest run gives: what is wanted is that run
START_PAYS = 0.85  # of a start's fuel: the plan pays for just the part of a start that it makes
START_SOON = 0.5  # of that is wanted in the seconds ahead: else better ones may come
SAME_G = 1e-5  # less is rounding: one start is as good as another
MUST_LEAST_S = 1e-3  # less is rounding: no second ahead has to run


def last_run_w(
    engine: Engine,
    going: Going,
    fuel_g_per_g: float,
    stages: Stages,
    internal_w: NDArray[np.float64],
) -> float:
    """Return the power at which a run goes on for all that the plan still wants; 0 if it need not.

    With E the least-cost power of the coming second, g what the battery gains by it, d what that
    second costs more than one with the engine off, all at the plan's prices (`Going`), and b the
    shortest run,

        W = sum_k h_k (l_off,k - G_k)

    is the energy that all of the plan takes from the engine. The run goes on if W is that of at
    least half a shortest run and of no more than one, b g / 2 <= W <= b g, if that costs no more
    than a start, d W / g <= c, and if no second ahead has to run anyway. Not where the plan wants
    heat: then that, not W, decides how long the engine runs. To be asked while it does.

    Parameters
    ----------
    engine : gives b and c
    going : the seconds ahead with the engine on
    fuel_g_per_g : w_F, what a gram of fuel costs in the coming second
    stages : of the plan, from now on
    internal_w : G, internal battery power of each stage by the plan, shape (n,)
    """
    if not table_of(engine).has_start or stages.must_s > MUST_LEAST_S:
        return 0.0
    power_w, gain_w, dearer_g_per_s = (float(each[0]) for each in going)
    if gain_w < LEAST_GAIN_W or fuel_g_per_g < FUEL_LEAST:
        return 0.0
    wanted_s = wanted_j(stages, internal_w) / gain_w
    is_one_run = WANTED_LEAST * engine.min_on_s <= wanted_s <= engine.min_on_s
    pays = dearer_g_per_s * wanted_s <= engine.start_fuel_g
    return power_w if is_one_run and pays else 0.0


def last_start_w(
    engine: Engine,
    going: Going,
    fuel_g_per_g: float,
    stages: Stages,
    internal_w: NDArray[np.float64],
) -> float:
    """Return the power at which the last run begins; 0 if it need not.

    With g_k and d_k of the k-th second as in `last_run_w`, a shortest run that begins in j seconds
    costs D_j, the sum of d_k over its b seconds, more than a rest, and one from now on gives J,
    that of g_k. It begins if it pays for its start, as long as it best lasts,

        D_0 + min(0, min_m sum of d_k over k = b .. m) <= -`START_PAYS` c

    which is what a plan of shares pays for the part of a start that it makes (such a run may give
    more than W: chosen by measurement), if no other shortest run in the short horizon costs less,
    if W is about that run, J / 2 <= W <= 3 J / 2, if the plan wants half of W or more in the short
    horizon, and if no second ahead has to run anyway. Neither where the plan wants heat nor where
    the trip ends sooner than the run. To be asked while the engine rests.

    Parameters
    ----------
    engine, going, fuel_g_per_g, stages, internal_w : as of `last_run_w`
    """
    run_s, short_stages = engine.min_on_s, len(going.power_w)
    asked = table_of(engine).has_start and stages.must_s <= MUST_LEAST_S
    lasts = 0 < run_s <= len(stages.seconds_w(short_stages))
    if not asked or not lasts or fuel_g_per_g < FUEL_LEAST:
        return 0.0

    gives_j = float(going.gain_w[:run_s].sum())
    of_all_j = wanted_j(stages, internal_w)
    is_one_run = START_LEAST * gives_j <= of_all_j <= START_MOST * gives_j
    is_soon = wanted_j(stages, internal_w, short_stages) >= START_SOON * of_all_j
    if not (is_one_run and is_soon):
        return 0.0
    dearer_g = stages.duration_s[:short_stages] * going.dearer_g_per_s
    runs_g = np.convolve(dearer_g, np.ones(run_s), "valid")
    goes_on_g = np.cumsum(dearer_g[run_s:]).min(initial=0.0)
    pays = runs_g[0] + goes_on_g <= -START_PAYS * engine.start_fuel_g
    begins = pays and runs_g[0] <= runs_g.min() + SAME_G
    return float(going.power_w[0]) if begins else 0.0


def wanted_j(
    stages: Stages, internal_w: NDArray[np.float64], first_stages: int | None = None
) -> float:
    """Return the energy that the plan takes from the engine, in all or its first stages."""
    taken_w = (stages.internal_off_w - internal_w)[:first_stages]
    return float((stages.duration_s[:first_stages] * taken_w).sum())
