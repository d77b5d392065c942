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
    beyond_w : largest engine power of a command beyond what the engine or its ramp allows
    power_w, soc, t_cl_k : largest excess beyond that of the best command of the grid, in order of
        priority
    held : seconds within a shortest run or rest whose wish was to end it
    cut_short : those of them in which it ended although going on would have kept all limits, with
        twice the margins of the layer
    """

    seconds: int = 0
    kept: int = 0
    beyond_w: float = 0.0
    power_w: float = 0.0
    soc: float = 0.0
    t_cl_k: float = 0.0
    held: int = 0
    cut_short: int = 0


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
        wishes = _wishes(len(at.soc), rng)
        commands = _commands(vehicle, at, wishes)
        excess = every.of(at, commands)
        least = every.least(at, excess)
        found.seconds += SECONDS_A_CAR
        found.kept += int(sum(not any(second) for second in zip(*excess, strict=True)))
        powers_w = np.array([command.p_eng_w for command in commands])
        found.beyond_w = max(found.beyond_w, float((powers_w - every.greatest_w(at)).max()))
        found.power_w = max(found.power_w, float((excess.power_w - least.power_w).max()))
        found.soc = max(found.soc, float((excess.soc - least.soc).max()))
        found.t_cl_k = max(found.t_cl_k, float((excess.t_cl_k - least.t_cl_k).max()))
        is_on, engine = at.engine_on > 0.0, vehicle.engine
        is_held = at.engine_for_s < np.where(is_on, engine.min_on_s, engine.min_off_s)
        is_held &= np.array([w.engine_on for w in wishes]) != is_on
        ended = np.array([c.engine_on for c in commands]) != is_on
        found.held += int(is_held.sum())
        found.cut_short += int((is_held & ended & every.could_go_on(at)).sum())
    return found


def _wishes(count: int, rng: np.random.Generator) -> list[Command]:
    """Random wishes, of numbers that are none too."""
    on = rng.integers(0, 2, count)
    power = rng.choice([0.0, np.nan, np.inf, -5e3], count)
    power = np.where(rng.random(count) < 0.7, rng.uniform(0.0, 1e5, count), power)
    return [Command(bool(on[i]), float(power[i])) for i in range(count)]


def _commands(vehicle: Vehicle, at: Seconds, wishes: list[Command]) -> list[Command]:
    """The layer's commands."""
    layer = SafetyLayer(Plant(vehicle))
    return [
        layer.admissible(
            wish,
            Observation(
                0,
                float(at.soc[i]),
                float(at.t_cl_degc[i]),
                bool(at.engine_on[i]),
                float(at.demand_w[i]),
                float(at.speed_mps[i]),
                int(at.engine_for_s[i]),
                float(at.p_eng_before_w[i]),
            ),
        )
        for i, wish in enumerate(wishes)
    ]
