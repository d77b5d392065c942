"""The coming second beside the plan: what it gets at least and at most, by the rules together.

A plan relaxes on and off to a share and knows the battery's and the coolant's limits at the ends of
stages; what that leaves to the single second is decided here, at the plan's prices.

The same in C: codegen/runtime/mpc_coming_second.c.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.battery_run import battery_run_w
from qpmpc.controllers.empty_battery import empty_battery_w
from qpmpc.controllers.full_battery import full_battery_w
from qpmpc.controllers.heating_run import heating_run_w
from qpmpc.controllers.last_run import last_run_w, last_start_w
from qpmpc.controllers.realise import ON_THRESHOLD
from qpmpc.controllers.short_run import short_run_w
from qpmpc.preview.stages import Stages
from qpmpc.pwa.curves import Curves
from qpmpc.pwa.priced import Going
from qpmpc.trip import Observation
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coming:
    """What the rules know of a plan.

    Attributes
    ----------
    stages : from now on
    on_share, internal_w : sigma and G of each by the plan, shape (n,)
    shares : sigma of the seconds ahead, as they will be realised, shape (N,)
    going : the seconds ahead with the engine on, shape (N,)
    fuel_g_per_g, store_g_per_j : w_F and w_G of the coming second
    """

    stages: Stages
    on_share: Floats
    internal_w: Floats
    shares: Floats
    going: Going
    fuel_g_per_g: float
    store_g_per_j: float


def most_w(vehicle: Vehicle, maps: BatteryMaps, coming: Coming, seen: Observation) -> float:
    """Return the most power that the battery has room for; infinite where it does not matter."""
    seconds = len(coming.going.power_w)
    return full_battery_w(vehicle, maps, coming.fuel_g_per_g, coming.stages, seconds, seen)


def least_w(
    vehicle: Vehicle,
    maps: BatteryMaps,
    curves: Curves,
    coming: Coming,
    seen: Observation,
    ramp_w: float,
    room_w: float,
) -> float:
    """Return the power that the coming second gets at least; 0 if nothing asks for any.

    Parameters
    ----------
    vehicle, maps : limits and the battery's curves
    curves : convex f and l
    coming, seen : the plan and the present
    ramp_w : least power for the ramp
    room_w : `most_w`
    """
    engine, stages, going = vehicle.engine, coming.stages, coming.going
    plan = (engine, going, coming.fuel_g_per_g, stages)
    shares = coming.shares
    power_w, net_w = float(going.power_w[0]), float(stages.net_w[0])
    empty_w = empty_battery_w(vehicle.battery, maps, net_w, seen.soc, min(power_w, room_w), ramp_w)
    if seen.engine_on:
        asked_w = [last_run_w(*plan, coming.internal_w)]
    else:
        asked_w = [last_start_w(*plan, coming.internal_w), short_run_w(*plan, shares)]
    battery_w = battery_run_w(vehicle, maps, going, stages, shares, seen)
    store = coming.store_g_per_j
    of_plan = (stages, coming.on_share, bool(shares[0] >= ON_THRESHOLD))
    heat_w = heating_run_w(vehicle, curves, power_w, store, *of_plan, seen)
    return max(ramp_w, empty_w, battery_w, heat_w, *asked_w)
