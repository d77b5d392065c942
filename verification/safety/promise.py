"""Distance of the safety layer from the best command of a second, as stated in docs/safety.md."""

from dataclasses import dataclass

import numpy as np

from qpmpc.controllers.safety import SafetyLayer
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, Vehicle
from qpmpc.verification.safety.every_command import EveryCommand, Seconds
from qpmpc.verification.safety.seconds import random_seconds, random_vehicle

SECONDS_A_CAR = 500


@dataclass
class Promise:
    """Result of many random seconds.

    Attributes
    ----------
    seconds, kept : tried, and those of them in which every limit is kept
    power_w, soc, t_cl_k : largest excess beyond that of the best command of the grid, in order of
        priority
    """

    seconds: int = 0
    kept: int = 0
    power_w: float = 0.0
    soc: float = 0.0
    t_cl_k: float = 0.0


def promise(cars: int, seed: int) -> Promise:
    """Compare the layer's commands with every command, for random cars, states and wishes.

    Parameters
    ----------
    cars : random vehicles, with `SECONDS_A_CAR` seconds each
    seed : of the random numbers
    """
    rng, found = np.random.default_rng(seed), Promise()
    for _ in range(cars):
        vehicle = random_vehicle(rng)
        at = random_seconds(vehicle, SECONDS_A_CAR, rng)
        every = EveryCommand(vehicle)
        excess = every.of(at, _commands(vehicle, at, rng))
        least = every.least(at, excess)
        found.seconds += SECONDS_A_CAR
        found.kept += int(sum(not any(second) for second in zip(*excess, strict=True)))
        found.power_w = max(found.power_w, float((excess.power_w - least.power_w).max()))
        found.soc = max(found.soc, float((excess.soc - least.soc).max()))
        found.t_cl_k = max(found.t_cl_k, float((excess.t_cl_k - least.t_cl_k).max()))
    return found


def _commands(vehicle: Vehicle, at: Seconds, rng: np.random.Generator) -> list[Command]:
    """The layer's commands for random wishes, of numbers that are none too."""
    layer = SafetyLayer(Plant(vehicle))
    count = len(at.soc)
    on = rng.integers(0, 2, count)
    power = rng.choice([0.0, np.nan, np.inf, -5e3], count)
    power = np.where(rng.random(count) < 0.7, rng.uniform(0.0, 1e5, count), power)
    return [
        layer.admissible(
            Command(bool(on[i]), float(power[i])),
            Observation(
                0,
                float(at.soc[i]),
                float(at.t_cl_degc[i]),
                bool(at.engine_on[i]),
                float(at.demand_w[i]),
                float(at.speed_mps[i]),
            ),
        )
        for i in range(count)
    ]
