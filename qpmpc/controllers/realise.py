"""From planned on-shares to on or off: a start or a stop only if the plan keeps to it.

The plan relaxes on and off to a share. It knows what a start costs, but not how long a run or a
rest has to last. Realised is what it mostly wants over the seconds that the choice binds.

The same in C: codegen/runtime/mpc_realise.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.qp.rows import table_of
from qpmpc.trip import Observation
from qpmpc.vehicle.must_run import must_run, too_fast
from qpmpc.vehicle.parameters import Vehicle

ON_THRESHOLD = 0.5  # share of a 1 s stage from which on the engine runs
# A run of a relaxed plan goes on below it, which spares starts; chosen in docs/studies/tuning.md.
STAY_SHARE = 0.35  # from this share on
STAY_S = 2.0  # and if the plan has this much left of the run


def engine_runs(
    on_share: NDArray[np.float64],
    arrival_s: int | None,
    seen: Observation,
    vehicle: Vehicle,
    least_w: float = 0.0,
    fast_s: int | None = None,
    stay_share: float = ON_THRESHOLD,
) -> bool:
    """Return whether the engine is to run in the coming second.

    With sigma_k the share of the k-th second ahead and b the seconds that a change binds
    (`engine.min_on_s` for a start, `engine.min_off_s` for a stop; at least 1), it is on where
    sigma_0 >= 1/2, where power is asked for now (`least_w`) and where the car is too fast, but

    - it is started only if the mean of sigma over the next b seconds is 1/2 at least and arrival
      is no nearer than b seconds, or if the battery alone cannot drive, the ramp asks for it or
      the car is too fast
    - it is stopped only if that mean is 1/2 at most and the car is not too fast within b seconds
    - where a start costs something it is not stopped while sigma_0 >= `stay_share` and at least
      `STAY_S` seconds are left of the run, in the mean of what the relaxed plan mixes:
      sum_k min(sigma_0, .., sigma_k), up to arrival

    Parameters
    ----------
    on_share : sigma, second by second from now on, shape (n,)
    arrival_s : seconds until the trip ends; None where that is beyond the plan
    seen : the present
    vehicle : gives b
    least_w : engine power that ramp, battery, or a run that begins or goes on ask for now, see
        `Plan.least_w`
    fast_s : seconds until the first that is too fast for an engine that is off; None without one
    stay_share : share from which on a run may go on; `STAY_SHARE` where only a start lets one rise
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
        soon_fast = fast_s is not None and 0 <= fast_s < bound_s
        return (
            mean > ON_THRESHOLD
            or soon_fast
            or _stays(on_share[: max(left_s, 0)], vehicle, stay_share)
        )
    net_w = seen.demand_w + vehicle.battery.aux_power_w
    must = least_w > 0.0 or must_run(vehicle, net_w, seen.speed_mps)
    arrives = arrival_s is not None and arrival_s < bound_s
    return must or (mean >= ON_THRESHOLD and not arrives)


def _stays(on_share: NDArray[np.float64], vehicle: Vehicle, stay_share: float) -> bool:
    """Whether a run goes on although its share is below `ON_THRESHOLD`.

    The part of it that goes on in second k is the least share up to then: only a start makes the
    share rise. To stop throws all of it away, and what is missing takes another start.
    """
    engine = vehicle.engine
    if not table_of(engine).has_start or len(on_share) == 0 or on_share[0] < stay_share:
        return False
    left_s = np.minimum.accumulate(np.maximum(on_share, 0.0)).sum()
    return bool(left_s >= STAY_S)


def power_while_on_w(
    on_share: NDArray[np.float64], p_eng_w: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Power E / sigma while on, of a mean power E; 0 where the engine will not run."""
    runs = on_share >= STAY_SHARE
    power = np.zeros_like(p_eng_w)
    np.divide(p_eng_w, np.minimum(on_share, 1.0), out=power, where=runs)
    return power


def second_of_power(on_share: NDArray[np.float64], stay_share: float) -> int:
    """Second whose power an engine that is to run gets: the first that the plan runs it in."""
    if on_share[0] >= stay_share:
        return 0
    return int(np.argmax(on_share >= ON_THRESHOLD))
