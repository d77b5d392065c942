"""A run of which the plan wants less than the shortest one begins where it costs least.

The plan knows what a start costs, not how long a run lasts. It starts the engine for the three
seconds of a launch that the battery cannot give, and the dwell makes four of them, the last at idle
behind it. In the second before, the engine has something to do.

The same in C: codegen/runtime/mpc_short_run.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.last_run import FUEL_LEAST, SAME_G
from qpmpc.controllers.realise import ON_THRESHOLD
from qpmpc.preview.stages import Stages
from qpmpc.pwa.priced import Going
from qpmpc.qp.rows import table_of
from qpmpc.vehicle.engine_parameters import Engine


def short_run_w(
    engine: Engine,
    going: Going,
    fuel_g_per_g: float,
    stages: Stages,
    on_share: NDArray[np.float64],
) -> float:
    """Return the power at which a run begins before the plan's; 0 if it need not.

    Let the first second in which the plan runs the engine, sigma_f >= 1/2, be less than the
    shortest run b away, 0 < f < b, and its start one that would be realised: second f leaves no
    choice, or the mean of sigma over b seconds from there is 1/2 at least. With d_k what second k
    costs more with the engine on, at the plan's prices (`Going`), and c_k = max(d_k, 0), a run that
    begins in s seconds instead spares

        G_s = sum of c_k over k = s + b .. f + b - 1 where sigma_k < 1/2,
              less the sum of c_k over k = s .. f - 1

    It begins now if G_0 is greater than all others and than 0, by more than rounding. Not where the
    seconds ahead end before f + b, nor where the plan wants heat. That the plan may run the engine
    again right behind is not counted. To be asked while it rests.

    Parameters
    ----------
    engine : gives b
    going, fuel_g_per_g : as of `last_run_w`
    stages : of the plan, from now on
    on_share : sigma of the seconds ahead by the plan, shape (N,)
    """
    run_s = engine.min_on_s
    runs = on_share >= ON_THRESHOLD
    first = int(np.argmax(runs))
    end = first + run_s
    lasts = 0 < first < run_s and end <= len(stages.seconds_w(len(on_share)))
    if not table_of(engine).has_start or not lasts or fuel_g_per_g < FUEL_LEAST:
        return 0.0
    is_started = np.clip(on_share[first:end], 0.0, 1.0).mean() >= ON_THRESHOLD
    if not is_started and stages.must_share[first] < ON_THRESHOLD:
        return 0.0
    costs_g = np.maximum(going.dearer_g_per_s[:end], 0.0)
    spared_g = np.where(runs[:end], 0.0, costs_g)
    # G_s - G_s+1, from s = f - 1 down to now; G_f = 0
    gains_g = np.cumsum((spared_g[run_s:] - costs_g[:first])[::-1])
    later_g = gains_g[:-1].max(initial=0.0)
    return float(going.power_w[0]) if gains_g[-1] > later_g + SAME_G else 0.0
