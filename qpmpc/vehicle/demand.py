"""Power demanded by a drive cycle."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.vehicle.parameters import Chassis, Vehicle

GRAVITY_MPS2 = 9.81
ROAD_LOAD_DEGC = 24.0
"""Ambient temperature of road-load coefficients: EPA tests at 20 to 30 degC."""


def cold_factor(chassis: Chassis, t_amb_degc: float) -> float:
    """Road load at an ambient temperature over that of its coefficients.

    1 + c max(24 degC - T_amb, 0): denser air, stiffer tyres, thicker oil.
    """
    return 1.0 + chassis.road_load_share_per_k * max(ROAD_LOAD_DEGC - t_amb_degc, 0.0)


def tractive_force_n(
    chassis: Chassis,
    t_amb_degc: float,
    speed_mps: NDArray[np.float64],
    accel_mps2: NDArray[np.float64],
    grade: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Force at the wheels, F = f (A + B v + C v^2) + m k dv/dt + m g sin(atan(grade)).

    f is `cold_factor`. All arrays of shape (n,); force in N, zero rolling resistance at standstill.
    """
    rolling = chassis.road_load_a_n * (speed_mps > 0.0)
    drag = chassis.road_load_b_n_per_mps * speed_mps + chassis.road_load_c_n_per_mps2 * speed_mps**2
    inertia = chassis.mass_kg * chassis.rotating_mass_factor * accel_mps2
    slope = chassis.mass_kg * GRAVITY_MPS2 * grade / np.sqrt(1.0 + grade**2)
    return cold_factor(chassis, t_amb_degc) * (rolling + drag) + inertia + slope


def regen_share(chassis: Chassis, speed_mps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the braking that is regenerative, the rest being that of the friction brakes.

    0 up to `regen_from_mps`, 1 from `regen_full_mps` on, in between a straight line; shape (n,).
    """
    begin, full = chassis.regen_from_mps, chassis.regen_full_mps
    if full <= 0.0:
        return np.ones_like(speed_mps)
    return np.clip((speed_mps - begin) / (full - begin), 0.0, 1.0)


def demand_w(cycle: Cycle, vehicle: Vehicle) -> NDArray[np.float64]:
    """Electrical-side power demand P_d of each 1 s step, paper eq. (2).

    P_d = F v / eta_drive when driving, F v eta_regen b(v) when braking, with b the share of
    `regen_share`. Speed is the mean of a step's two ends, acceleration their difference.

    Returns
    -------
    power in W, shape (steps,); not yet clipped at the battery's charge limit
    """
    chassis, speed = vehicle.chassis, cycle.step_speed_mps
    force = tractive_force_n(
        chassis, vehicle.thermal.t_amb_degc, speed, cycle.step_accel_mps2, cycle.step_grade
    )
    wheel_w = force * speed
    braking_w = wheel_w * chassis.eta_regen * regen_share(chassis, speed)
    return np.where(wheel_w >= 0.0, wheel_w / chassis.eta_drive, braking_w)
