"""Power demanded by a drive cycle."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.vehicle.parameters import Chassis

GRAVITY_MPS2 = 9.81


def tractive_force_n(
    chassis: Chassis,
    speed_mps: NDArray[np.float64],
    accel_mps2: NDArray[np.float64],
    grade: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Force at the wheels, F = A + B v + C v^2 + m k dv/dt + m g sin(atan(grade)).

    All arrays of shape (n,); force in N, zero rolling resistance at standstill.
    """
    rolling = chassis.road_load_a_n * (speed_mps > 0.0)
    drag = chassis.road_load_b_n_per_mps * speed_mps + chassis.road_load_c_n_per_mps2 * speed_mps**2
    inertia = chassis.mass_kg * chassis.rotating_mass_factor * accel_mps2
    slope = chassis.mass_kg * GRAVITY_MPS2 * grade / np.sqrt(1.0 + grade**2)
    return rolling + drag + inertia + slope


def demand_w(cycle: Cycle, chassis: Chassis) -> NDArray[np.float64]:
    """Electrical-side power demand P_d of each 1 s step, paper eq. (2).

    P_d = F v / eta_drive when driving, F v eta_regen when braking. Speed is the mean of a
    step's two ends, acceleration their difference.

    Returns
    -------
    power in W, shape (steps,); not yet clipped at the battery's charge limit
    """
    speed = cycle.step_speed_mps
    force = tractive_force_n(chassis, speed, cycle.step_accel_mps2, cycle.step_grade)
    wheel_w = force * speed
    return np.where(wheel_w >= 0.0, wheel_w / chassis.eta_drive, wheel_w * chassis.eta_regen)
