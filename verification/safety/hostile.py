"""A hostile drive: broken sensors, clocks and previews, restarts; C and Python side by side."""

from collections import Counter
from dataclasses import astuple, dataclass, field
from math import inf, isfinite, nan

import numpy as np

from qpmpc.codegen.controller import GeneratedController
from qpmpc.controllers.base import Decision
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.monitor import Flag
from qpmpc.preview.stages import Preview, Stages
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import Command, Vehicle
from qpmpc.verification.independent.equations import Floats
from qpmpc.verification.safety.every_command import EveryCommand, Excess, Seconds

SAME_W = 1.0
NUMBERS = (nan, inf, -inf, 0.0, -1.0, 1.0, 0.41, 0.79, 40.1, 89.9, 1e3, -3e4, 7e4, 1e6, -1e6, 1e300)
SIGNALS = ("soc", "t_cl_degc", "demand_w", "speed_mps")
QUIET = 0.6  # share of seconds in which nothing is wrong


@dataclass
class Hostile:
    """What a hostile drive found.

    Attributes
    ----------
    steps, planned : seconds, and those with a new plan
    flags, rungs : how often each was seen
    faults : seconds in which something that must hold did not, with the reason
    avoidable : largest excess beyond the best command, in seconds with true measurements and clock
    """

    steps: int = 0
    planned: int = 0
    flags: Counter[str] = field(default_factory=Counter)
    rungs: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    avoidable: tuple[float, float, float] = (0.0, 0.0, 0.0)


class _Drive:
    """Both controllers on one plant that is driven by what C commands."""

    def __init__(self, trip: Trip, rng: np.random.Generator) -> None:
        self.trip, self.rng = trip, rng
        self.c, self.python = GeneratedController(trip), MhQp(trip)
        source = self.python.planner.preview.source
        self._good, self._told = source.preview, source.preview(0)
        # the navigation system has its own clock: it is not misled by that of the controllers
        self.c.inputs.receive = self.python.planner.preview.receive = lambda step: self._told
        self.python.begin(trip)
        self.c.begin(trip)

    def decide(
        self, second: int, told: Observation, bad_preview: bool
    ) -> tuple[Decision, Decision]:
        """Both decisions of one second, from the same preview."""
        preview = self._good(second)
        self._told = _spoilt(preview, self.rng) if bad_preview else preview
        return self.c.decide(told), self.python.decide(told)


def hostile_drive(trip: Trip, steps: int, seed: int) -> Hostile:
    """Drive and look at every second; the trip begins anew at arrival.

    Parameters
    ----------
    trip : whose demand and preview are the truth
    steps : in all
    seed : of what goes wrong
    """
    rng, found = np.random.default_rng(seed), Hostile()
    drive = _Drive(trip, rng)
    state, clock, true = trip.plant.initial_state(), 0, []
    commands: list[Command] = []
    for k in range(steps):
        now = k % trip.steps
        seen = trip.observation(now, state)
        clock = clock + 1 if k else 0
        told = seen._replace(step=clock)
        bad_preview = False
        if rng.random() > QUIET:
            told, clock = _told(told, rng)
            bad_preview = bool(rng.random() < 0.3)
        if rng.random() < 0.003:
            drive.c.forget()
            drive.python.forget()
        mine, its = drive.decide(now, told, bad_preview)
        found.steps += 1
        found.planned += not mine.fallback
        found.rungs[mine.fallback or "plan"] += 1
        found.flags.update(mine.flags.names())
        reason = _disagreement(mine, its, trip.vehicle)
        if reason:
            found.faults.append(f"second {k}: {reason}: {told}, {mine}, {its}")
        if told[1:] == seen[1:] and not mine.flags & (Flag.BAD_MEASUREMENT | Flag.BAD_CLOCK):
            for_s, power_w = state.engine_for_s, state.p_eng_w
            true.append(seen._replace(engine_for_s=for_s, p_eng_before_w=power_w))
            commands.append(mine.command)
        state, _ = trip.plant.step(state, mine.command, seen.demand_w, seen.speed_mps)
    found.avoidable = _avoidable(trip.vehicle, true, commands)
    return found


def _told(seen: Observation, rng: np.random.Generator) -> tuple[Observation, int]:
    """What the controller is told instead of the truth, and the clock."""
    step = seen.step
    kind = rng.random()
    if kind < 0.2:
        step += int(rng.choice([-1, -1, 1, 5, 30, -1000, 10**6]))
    changed: dict[str, float] = {}
    for name in rng.choice(SIGNALS, rng.integers(0, 3), replace=False):
        value = float(rng.choice(NUMBERS))
        if rng.random() < 0.5:
            value = getattr(seen, str(name)) * (1.0 + 0.1 * rng.normal())
        changed[str(name)] = value
    return Observation(**{**seen._asdict(), **changed, "step": step}), step


def _spoilt(preview: Preview, rng: np.random.Generator) -> Preview:
    """A preview of which something is wrong: numbers, length, or everything within bounds."""
    kind = rng.integers(0, 4)
    if kind == 0:
        return preview._replace(short_count=int(rng.choice([-1, 0, 3, 21, 10**6])))
    long = preview.long
    values = list(astuple(long))  # copies
    if kind == 1:
        demand = preview.short_demand_w.copy()
        demand[rng.integers(len(demand))] = rng.choice(NUMBERS)
        return preview._replace(short_demand_w=demand)
    if kind == 2:
        at = rng.integers(len(values))
        values[at][rng.integers(len(values[at]))] = rng.choice(NUMBERS)
    else:
        n = len(long.duration_s)
        values = [rng.uniform(0, 60, n), *(rng.uniform(-2e4, 3e4, n) for _ in range(3))]
        values[2] = np.abs(values[2]) * 1e-3
        values += [
            rng.uniform(0, 1, n),
            values[1],  # of the seconds with a choice: as of all
            values[3],
            rng.uniform(0, 60, n),
            *(rng.uniform(0, 3e6, n) for _ in range(2)),
        ]
    return preview._replace(long=Stages(*values))


def _disagreement(mine: Decision, its: Decision, vehicle: Vehicle) -> str:
    """Why a second fails; empty if it does not."""
    command = mine.command
    if not (isfinite(command.p_eng_w) and 0.0 <= command.p_eng_w <= vehicle.engine.power_max_w):
        return "command out of range"
    if command.p_eng_w > 0.0 and not command.engine_on:
        return "power with the engine off"
    if (mine.fallback, mine.flags) != (its.fallback, its.flags):
        return "rung or flags differ"
    same = command.engine_on == its.command.engine_on
    if not same or abs(command.p_eng_w - its.command.p_eng_w) > SAME_W:
        return "commands differ"
    return ""


def _avoidable(
    vehicle: Vehicle, seen: list[Observation], commands: list[Command]
) -> tuple[float, float, float]:
    at = Seconds(*(_column(seen, name) for name in Seconds.__dataclass_fields__))
    every = EveryCommand(vehicle)
    found = every.of(at, commands)
    worst = [0.0, 0.0, 0.0]
    for first in range(0, len(seen), 500):  # in parts: all commands of all seconds are many
        part = slice(first, first + 500)
        some = Seconds(*(getattr(at, name)[part] for name in Seconds.__dataclass_fields__))
        of_part = Excess(*(each[part] for each in found))
        least = every.least(some, of_part)
        for i, (have, best) in enumerate(zip(of_part, least, strict=True)):
            worst[i] = max(worst[i], float((have - best).max()))
    return worst[0], worst[1], worst[2]


def _column(seen: list[Observation], name: str) -> Floats:
    return np.array([float(getattr(one, name)) for one in seen])
