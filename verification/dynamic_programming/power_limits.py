"""Engine powers with which battery and ramp keep their limits, second by second."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle import Vehicle
from qpmpc.vehicle.must_run import must_run, too_fast
from qpmpc.verification.dynamic_programming.engine_states import STEP_S

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class PowerLimits(NamedTuple):
    """Least and greatest engine power, and whether there is any; shape (n,) each."""

    low_w: Floats
    high_w: Floats
    allowed: Bools

    @classmethod
    def between(cls, low_w: Floats, high_w: Floats) -> Self:
        """Limits that may leave nothing."""
        return cls(low_w, high_w, low_w <= high_w)


def power_limits(
    vehicle: Vehicle, demand_w: Floats, speed_mps: Floats
) -> tuple[PowerLimits, PowerLimits, Bools]:
    """Return the limits of an engine that ran before, of one that starts, and where off is allowed.

    With the engine on its power keeps the battery within its limits,

        P_d + P_aux + P_crank - P_dis_max <= P_eng <= max(P_d, 0) + P_aux + P_crank + P_chg_max,

    as far as its own limits allow; P_crank is zero unless it starts. Braking beyond the charge
    limit goes to the friction brakes. With the engine off, P_d + P_aux <= P_dis_max and the car is
    not too fast for that (`qpmpc.vehicle.must_run`). Where even full engine power is not enough,
    the engine runs at full power.

    The ramp makes it rise in time: before a second that needs P, it gives at least P - ramp, and
    is off only if it can start with P, cranking included.
    """
    engine, battery = vehicle.engine, vehicle.battery
    net_w = demand_w + battery.aux_power_w
    driving_w = np.maximum(demand_w, 0.0) + battery.aux_power_w
    cranking_w = engine.start_energy_j / STEP_S
    ramp_w = engine.ramp_w_per_s * STEP_S
    high_w = np.minimum(engine.power_max_w, driving_w + vehicle.battery_charge_max_w)
    high_start_w = np.minimum(
        engine.power_max_w, driving_w + cranking_w + vehicle.battery_charge_max_w
    )
    least_w = net_w - vehicle.battery_discharge_max_w
    must = must_run(vehicle, net_w, speed_mps)
    is_fast = too_fast(vehicle, speed_mps)
    off_allowed = ~must
    needed_w = np.minimum(least_w, engine.power_max_w)
    for k in range(len(demand_w) - 2, -1, -1):
        then_w = needed_w[k + 1]
        if then_w > 0.0:
            rising_w = min(then_w - ramp_w, high_w[k])
            needed_w[k] = max(needed_w[k], rising_w)
        if then_w > 0.0 or is_fast[k + 1]:
            off_allowed[k] &= min(then_w + cranking_w, engine.power_max_w) <= ramp_w
    low_w = np.maximum(engine.power_min_w, needed_w)
    low_start_w = np.minimum(np.maximum(low_w, least_w + cranking_w), engine.power_max_w)
    running = PowerLimits.between(low_w, high_w)
    starting = PowerLimits.between(low_start_w, high_start_w)
    return running, starting, off_allowed | ~running.allowed
