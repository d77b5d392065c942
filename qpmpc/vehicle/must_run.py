"""Seconds in which the engine must run: for its power, or because of the speed of the car."""

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.parameters import Vehicle

# Speeds that differ by less are the same: single precision, and digits that a file leaves out.
SPEED_ROUNDING_MPS = 1e-5

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def fastest_off_mps(vehicle: Vehicle) -> float:
    """Return the mean speed, m/s, above which the engine must run."""
    return vehicle.engine.electric_max_mps + SPEED_ROUNDING_MPS


@overload
def too_fast(vehicle: Vehicle, speed_mps: float) -> bool: ...
@overload
def too_fast(vehicle: Vehicle, speed_mps: Floats) -> Bools: ...
def too_fast(vehicle: Vehicle, speed_mps: Any) -> Any:
    """Return whether the engine must run at this mean speed, at any power its limits allow.

    Parameters
    ----------
    speed_mps : a number or shape (n,)
    """
    return speed_mps > fastest_off_mps(vehicle)


def begun_s(vehicle: Vehicle, engine_on: bool, engine_for_s: int) -> int:
    """Return for how many seconds a run of the engine that has begun has to go on.

    Parameters
    ----------
    engine_on, engine_for_s : whether it runs, and for how long it has
    """
    return max(vehicle.engine.min_on_s - engine_for_s, 0) if engine_on else 0


def whole_runs(vehicle: Vehicle, must: Bools) -> Bools:
    """Return the seconds in which the engine runs because it must, or must have lately.

    A run that begins because the engine must lasts `engine.min_on_s` seconds.

    Parameters
    ----------
    must : whether the engine must run, second by second, shape (n,)
    """
    begins = must.copy()
    begins[1:] &= ~must[:-1]
    runs = must.copy()
    for late in range(1, vehicle.engine.min_on_s):
        runs[late:] |= begins[:-late]
    return runs


@overload
def must_run(vehicle: Vehicle, net_w: float, speed_mps: float) -> bool: ...
@overload
def must_run(vehicle: Vehicle, net_w: Floats, speed_mps: Floats) -> Bools: ...
def must_run(vehicle: Vehicle, net_w: Any, speed_mps: Any) -> Any:
    """Return whether the engine must run: P0 > P_dis_max, or v > v_electric_max.

    Of a long stage both are means, as the stage's plan is one.

    Parameters
    ----------
    net_w : P0 = P_d + P_aux, W, a number or shape (n,)
    speed_mps : mean speed, likewise
    """
    return (net_w > vehicle.battery_discharge_max_w) | too_fast(vehicle, speed_mps)
