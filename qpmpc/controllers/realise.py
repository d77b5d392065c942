"""From planned on-shares to on or off: a start or a stop only if the plan keeps to it.

The plan relaxes on and off to a share. It knows what a start costs, but not how long a run or a
rest has to last. Realised is what it mostly wants over the seconds that the choice binds.

The same in C: codegen/runtime/mpc_realise.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.trip import Observation
from qpmpc.vehicle.must_run import must_run, too_fast
from qpmpc.vehicle.parameters import Vehicle

ON_THRESHOLD = 0.5  # share of a 1 s stage from which on the engine runs


def engine_runs(
    on_share: NDArray[np.float64],
    arrival_s: int | None,
    seen: Observation,
    vehicle: Vehicle,
    least_w: float = 0.0,
    fast_s: int | None = None,
) -> bool:
    """Return whether the engine is to run in the coming second.

    With sigma_k the share of the k-th second ahead and b the seconds that a change binds
    (`engine.min_on_s` for a start, `engine.min_off_s` for a stop; at least 1), it is on where
    sigma_0 >= 1/2, where the ramp asks for power now and where the car is too fast, but

    - it is started only if the mean of sigma over the next b seconds is 1/2 at least and arrival
      is no nearer than b seconds, or if the battery alone cannot drive, the ramp asks for it or
      the car is too fast
    - it is stopped only if that mean is 1/2 at most and the car is not too fast within b seconds

    Parameters
    ----------
    on_share : sigma, second by second from now on, shape (n,)
    arrival_s : seconds until the trip ends; None where that is beyond the plan
    seen : the present
    vehicle : gives b
    least_w : engine power that the ramp asks for now, see `qpmpc.controllers.ramp`
    fast_s : seconds until the first that is too fast for an engine that is off; None without one
    """
    engine = vehicle.engine
    wish = bool(on_share[0] >= ON_THRESHOLD or least_w > 0.0 or too_fast(vehicle, seen.speed_mps))
    if wish == seen.engine_on:
        return wish
    bound_s = max(engine.min_on_s if wish else engine.min_off_s, 1)
    left_s = len(on_share) if arrival_s is None else arrival_s
    ahead = np.clip(on_share[: max(min(bound_s, left_s), 1)], 0.0, 1.0)
    mean = float(ahead.sum()) / len(ahead)
    if not wish:
        return mean > ON_THRESHOLD or (fast_s is not None and 0 <= fast_s < bound_s)
    net_w = seen.demand_w + vehicle.battery.aux_power_w
    must = least_w > 0.0 or must_run(vehicle, net_w, seen.speed_mps)
    arrives = arrival_s is not None and arrival_s < bound_s
    return must or (mean >= ON_THRESHOLD and not arrives)
