"""Random seconds and cars, most of them where limits bind."""

from contextlib import suppress

import numpy as np

from qpmpc.errors import InputError
from qpmpc.vehicle import Vehicle, load_vehicle, vehicle_names
from qpmpc.verification.independent.equations import Equations, Floats
from qpmpc.verification.safety.every_command import Seconds


def random_vehicle(rng: np.random.Generator) -> Vehicle:
    """Return a shipped car in extreme weather, with another coolant, engine and auxiliaries.

    Drawn again where it is refused: so little coolant would swing within a second beside the
    largest radiator.
    """
    while True:
        with suppress(InputError):
            return _drawn(rng)


def _drawn(rng: np.random.Generator) -> Vehicle:
    return load_vehicle(str(rng.choice(vehicle_names()))).with_settings(
        {
            "thermal.t_amb_degc": rng.uniform(-40.0, 45.0),
            "thermal.cabin_heat_w": rng.uniform(0.0, 4000.0),
            "thermal.heat_capacity_j_per_k": rng.uniform(20e3, 200e3),
            "thermal.radiator_w_per_k": float(rng.choice([0.0, 150.0, 900.0])),
            "battery.aux_power_w": rng.uniform(0.0, 2000.0),
            "battery.derating_share_per_k": float(rng.choice([0.0, 0.012])),
            "engine.power_min_w": float(rng.choice([0.0, 2000.0])),
            "engine.start_fuel_g": float(rng.choice([0.0, 0.3])),
            "engine.start_energy_j": float(rng.choice([0.0, 5e3])),
            "engine.ramp_w_per_s": float(rng.choice([8e3, 1e6])),
            "engine.min_on_s": int(rng.choice([0, 4])),
            "engine.min_off_s": int(rng.choice([0, 3])),
            "engine.electric_max_mps": float(rng.choice([25.0, 70.0])),
        }
    )


def random_seconds(vehicle: Vehicle, count: int, rng: np.random.Generator) -> Seconds:
    """Return seconds over the whole state space, at its edges and some way beyond."""
    battery, thermal = vehicle.battery, vehicle.thermal
    soc = _around(rng, count, battery.soc_min, battery.soc_max, (1e-6, 1e-4, 1e-3, 0.05))
    t_cl = _around(rng, count, thermal.t_cl_min_degc, thermal.t_cl_max_degc, (1e-4, 0.02, 0.3, 8.0))
    most_w = Equations(vehicle).discharge_max_w + vehicle.engine.power_max_w
    wide_w = rng.uniform(-1.3 * most_w, 1.3 * most_w, count)
    narrow_w = rng.normal(0.0, 3e3, count)
    running = rng.integers(0, 2, count).astype(float)
    return Seconds(
        soc=soc,
        t_cl_degc=t_cl,
        engine_on=running,
        demand_w=np.where(rng.random(count) < 0.5, wide_w, narrow_w),
        speed_mps=rng.uniform(0.0, 45.0, count),
        engine_for_s=rng.integers(1, 8, count).astype(float),
        p_eng_before_w=running * rng.uniform(0.0, vehicle.engine.power_max_w, count),
    )


def _around(
    rng: np.random.Generator, count: int, low: float, high: float, scales: tuple[float, ...]
) -> Floats:
    """Half of the values anywhere inside, half about the two limits, on various scales."""
    inside = rng.uniform(low, high, count)
    edge = rng.choice([low, high], count) + rng.choice(scales, count) * rng.uniform(-1, 1, count)
    return np.where(rng.random(count) < 0.5, inside, edge)
