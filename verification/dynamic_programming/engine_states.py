"""States of the engine: on or off, and for how long, as far as that makes a difference."""

from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle import PlantState
from qpmpc.vehicle.engine_parameters import Engine

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
NEVER = -1
STEP_S = 1.0


@dataclass(frozen=True)
class EngineStates:
    """States e = 0..count-1: off for 1, 2, .. `rests` seconds or more, then on for 1, 2, ..

    Where neither starts nor stops make a difference there is one state, whatever the engine does.
    The last state of each kind stands for all longer times.

    Attributes
    ----------
    rests : number of states off
    is_start : whether an engine that is on in the next second starts then; not of the single state
    on_next, off_next : state after a second on or off; `NEVER` if that breaks a shortest run or
        rest. Shape (count,), as all
    most_w : greatest power in the next second, the ramp rising from zero since the start
    may_end : whether the engine, on in the next second, may be off from then on
    """

    rests: int
    is_start: Bools
    on_next: Ints
    off_next: Ints
    most_w: NDArray[np.float64]
    may_end: Bools

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.on_next)

    @classmethod
    def of(cls, engine: Engine, power_high_w: float, steps: int) -> Self:
        """States that this engine needs on a trip where it never gives more than `power_high_w`."""
        ramp_w = engine.ramp_w_per_s * STEP_S
        rising_s = ceil(power_high_w / ramp_w)
        min_on_s, min_off_s = min(engine.min_on_s, steps), min(engine.min_off_s, steps)
        free = (
            engine.start_fuel_g == 0.0
            and engine.start_energy_j == 0.0
            and max(min_on_s, min_off_s, rising_s) <= 1
        )
        if free:
            zero = np.zeros(1, dtype=np.int64)
            yes = np.ones(1, dtype=np.bool_)
            return cls(0, ~yes, zero, zero, np.full(1, np.inf), yes)
        rests, runs = max(min_off_s, 1), max(min_on_s, min(rising_s - 1, steps), 1)
        rested, run = np.arange(1, rests + 1), np.arange(1, runs + 1)
        on_next = np.concatenate(
            (
                np.where(rested >= min_off_s, rests, NEVER),
                rests + np.minimum(run, runs - 1),
            )
        )
        off_next = np.concatenate(
            (np.minimum(rested, rests - 1), np.where(run >= min_on_s, 0, NEVER))
        )
        most_w = np.concatenate((np.full(rests, ramp_w), (run + 1) * ramp_w))
        most_w[-1] = np.inf
        run_then = np.concatenate((np.ones(rests), run + 1))
        return cls(
            rests,
            np.arange(rests + runs) < rests,
            on_next,
            off_next,
            most_w,
            run_then >= min_on_s,
        )

    def number(self, state: PlantState) -> int:
        """Number of a state of the plant."""
        if self.count == 1:
            return 0
        if state.engine_on:
            return self.rests + min(state.engine_for_s, self.count - self.rests) - 1
        return min(state.engine_for_s, self.rests) - 1

    def may_stop(self, number: int) -> bool:
        """Tell whether the engine may be off in the next second."""
        return bool(self.off_next[number] != NEVER)

    def same_as(self, high_w: float, following: Ints) -> Ints:
        """For each state, the last one whose value function is the same at one time.

        Two states on have the same one if the engine may stop in both, the ramp binds in neither,
        and they lead to the same one.

        Parameters
        ----------
        high_w : greatest power that the second allows
        following : the same one time later, shape (count,)
        """
        same = np.arange(self.count)
        last = self.count - 1
        for e in range(self.rests, last):
            if (
                self.off_next[e] == self.off_next[last]
                and self.most_w[e] >= high_w
                and following[self.on_next[e]] == following[self.on_next[last]]
            ):
                same[e] = last
        return same
