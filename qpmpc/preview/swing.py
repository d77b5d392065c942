"""What the battery's energy swings inside a block, which its statistics do not tell.

Inside a long block braking fills the battery and launches drain it. A plan that knows only where
the block ends would end it at a limit; on the road the braking energy is then thrown away. So two
numbers of each block's end go with its statistics: how far below and above it the battery's energy
comes around there. They are found once, for as many fixed places of the trip as it has blocks, and
a block has those of the place where it ends; the upper only as far as there is a use for it at its
last second. A third goes with the short horizon, second by second: the room that the braking beyond
it needs.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

NO_LIMIT_J = 1e10
"""Beyond any car's battery: of the classes inside a block, whose order in time is not known."""
LEAST_KEPT_J = 1.0
"""Tells the end of a block, with however little swing, from a second and from a block passed."""
DRAIN_SHARE = 0.8
"""Of what driving with the engine off takes out of the battery."""
FILLED_SHARE = 0.5
"""Of the battery's energy between its limits: no more is kept from either limit. A long descent in
the cold has no use for more room: the heat that it needs comes from an engine that charges."""
FALL_SHARE = 0.5
"""Of what is kept from the upper limit for a swing, from the lower: there the engine can help."""
STRETCHES, STRETCH_S = 900, 8
"""Of the trip, each so long or longer in a trip of over two hours: in one `uses` is one number."""


def swings(
    forecast: Trace,
    vehicle: Vehicle,
    settings: HorizonSettings,
    start: NDArray[np.intp],
    end: NDArray[np.intp],
) -> Floats:
    """Energy to keep from the lower and from the upper SOC limit at the end of each place, J.

    With l the internal power with the engine off, from the start of a place to each t in it,

        path(t) = sum of -l outside hard driving, and of a constant in hard driving (everywhere,
                  where there is none) with which the path ends where it began; but no engine
                  takes, so it is at least that of an engine at rest, and a descent ends above

    is what an engine leads to that runs in hard driving. It can be run so that the battery swings
    less: of place b and the next, which begins there, a share s is kept,

        fall_b = s max(fall of path_b, fall of path_b+1),   fall of path = -min path
        rise_b = s max(rise of path_b, rise of path_b+1),   rise of path = max path - max(end, 0)

    each at most half of the room between the limits, of the fall `FALL_SHARE`, and at least
    `LEAST_KEPT_J`. One class has no swing: an averaged preview knows nothing of it.

    Parameters
    ----------
    forecast : of the whole trip
    start, end : first second of each place and that after its last, shape (places,)

    Returns
    -------
    fall and rise, shape (2, places)
    """
    if settings.classes == 1 or not len(start):
        return np.full((2, len(start)), LEAST_KEPT_J)
    flow_w = -forecast.internal_off_w(vehicle)
    is_hard = forecast.demand_w > settings.class_hard_w
    own = np.array([_swing(flow_w[a:b], is_hard[a:b]) for a, b in zip(start, end, strict=True)]).T
    following = np.append(own[:, 1:], np.zeros((2, 1)), axis=1)
    kept = np.minimum(settings.swing_share * np.maximum(own, following), _most_j(vehicle))
    found: Floats = np.maximum(np.array([[FALL_SHARE], [1.0]]) * kept, LEAST_KEPT_J)
    return found


def rooms(forecast: Trace, vehicle: Vehicle, settings: HorizonSettings) -> Floats:
    """Room below the upper SOC limit that the trip from each second on needs, J.

    With l the internal power with the engine off, negative in braking,

        R_t = max(R_t+1 - l_t, 0) in braking,   max(R_t+1 - `DRAIN_SHARE` l_t, 0) in driving

    and at most `FILLED_SHARE` of what the battery holds between its limits; 0 at arrival. A battery
    that has less room throws braking energy away even if the engine rests until then. A share of
    the driving counts, because the engine also runs for heat, for speed and for its shortest runs.
    One class has none: an averaged preview knows nothing of braking.

    Parameters
    ----------
    forecast : of the whole trip

    Returns
    -------
    shape (steps + 1,)
    """
    internal_w = forecast.internal_off_w(vehicle)
    taken_w = np.where(internal_w > 0.0, DRAIN_SHARE * internal_w, internal_w)
    return _levels(-taken_w[::-1], vehicle, settings)[::-1]


def drops(forecast: Trace, vehicle: Vehicle, settings: HorizonSettings) -> Floats:
    """Energy that the battery has lost by each second since it was highest, J.

    With l the internal power with the engine off and s the share of the swing that is kept,

        D_t+1 = max(D_t + l_t, 0) in braking,   D_t + s l_t in driving,   D_t in hard driving

    and at most `FILLED_SHARE` of what the battery holds between its limits; 0 at departure. A
    battery that now has less room than that has been at its limit. One class has none, as in
    `rooms`.

    Parameters
    ----------
    forecast : of the whole trip

    Returns
    -------
    shape (steps + 1,)
    """
    internal_w = forecast.internal_off_w(vehicle)
    driving_w = np.where(forecast.demand_w > settings.class_hard_w, 0.0, internal_w)
    lost_w = np.where(internal_w > 0.0, settings.swing_share * driving_w, internal_w)
    return _levels(lost_w, vehicle, settings)


def uses(room_j: Floats, drop_j: Floats) -> Floats:
    """Energy below the upper SOC limit that there is a use for at the end of each second, J.

    For the braking to come, or for what the battery has lost since it was highest: the most of
    max(R, D) in the stretch of the trip around there, one of `STRETCHES` of `STRETCH_S` or more.

    Parameters
    ----------
    room_j, drop_j : R and D of `rooms` and `drops`, shape (steps + 1,)

    Returns
    -------
    shape (steps,)
    """
    of_second = np.maximum(room_j, drop_j)[1:]
    steps = len(of_second)
    length = max(STRETCH_S, -(-steps // STRETCHES))
    most = np.maximum.reduceat(of_second, np.arange(0, steps, length))
    found: Floats = np.repeat(most, length)[:steps]
    return found


def _levels(rise_w: Floats, vehicle: Vehicle, settings: HorizonSettings) -> Floats:
    """Sum of 1 s steps from 0, clipped after each to 0 and `_most_j`; 0 with one class.

    Returns
    -------
    shape (steps + 1,)
    """
    found = np.zeros(len(rise_w) + 1)
    if settings.classes == 1:
        return found
    most = _most_j(vehicle)
    for step, rise in enumerate(rise_w):
        found[step + 1] = min(max(found[step] + rise, 0.0), most)
    return found


def _most_j(vehicle: Vehicle) -> float:
    """Energy that is kept from an SOC limit at most, J."""
    battery = vehicle.battery
    room = battery.soc_max - battery.soc_min
    return FILLED_SHARE * room * BatteryMaps(battery).energy_j(vehicle.trip.soc_mean)


def _swing(flow_w: Floats, is_hard: NDArray[np.bool_]) -> tuple[float, float]:
    """Largest fall and rise of `path` in one place of 1 s steps, J."""
    if not len(flow_w):
        return 0.0, 0.0
    repaid = is_hard if is_hard.any() else np.ones_like(is_hard)
    kept_w = np.where(is_hard, 0.0, flow_w)
    least_w = float(flow_w[is_hard].mean()) if is_hard.any() else 0.0
    path = np.cumsum(kept_w + max(-kept_w.sum() / repaid.sum(), least_w) * repaid)
    return max(-path.min(), 0.0), max(path.max() - max(path[-1], 0.0), 0.0)
