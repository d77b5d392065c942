"""The multi-horizon grid: a short, fine horizon and a long, coarse one that shrinks to arrival."""

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from qpmpc.errors import InputError

BLOCKS_MAX = 500
"""Of a trip: memory and time of a step grow with them; a block of a day's drive is then 3 min."""


class HorizonSettings(BaseModel):
    """Layout of the stages.

    Attributes
    ----------
    short_stages : N stages of 1 s with accurate preview
    blocks : number of equal blocks into which what is ahead beyond the short horizon is cut, every
        second anew; but for the first, none is shorter than the short horizon. Or
    block_s : length of a block, s, at its own place on the trip; used when `blocks` is 0. With both
        0 there is no long horizon: the short one recedes to arrival
    classes : 3 demand classes per block (hard, easy, braking) or 1 (the mean, as in the paper)
    class_hard_w, class_braking_w : demand above the first is hard, below the second braking
    swing_share : share of the swing that an engine in hard driving leads to, by which the SOC
        limits at the end of a block are tightened, the lower one by half of it, see
        `qpmpc.preview.swing`
    rise_share : starts that a block costs, per rise of its demand into a class and per on-share
        there. Less than 1: an engine that runs in part of a class does so in its longest episodes
    entry_share : starts that a block costs, per on-share of its first class that is more than at
        the end of the block before; of its rises into each class as much less counts
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    short_stages: Annotated[int, Field(ge=1, le=2000)] = 20
    blocks: Annotated[int, Field(ge=0, le=BLOCKS_MAX)] = 14
    block_s: Annotated[int, Field(ge=0, le=3600)] = 120
    classes: Literal[1, 3] = 3
    class_hard_w: Annotated[float, Field(ge=-1e6, le=1e6)] = 8000.0
    class_braking_w: Annotated[float, Field(ge=-1e6, le=1e6)] = -500.0
    swing_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.85
    rise_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.75
    entry_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.25

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.class_braking_w > self.class_hard_w:
            raise ValueError("class_braking_w must not be above class_hard_w")
        return self

    def idle(self) -> set[str]:
        """Return the names of settings that have no effect beside the others."""
        found = {"block_s"} if self.blocks else set()
        has_blocks = self.blocks or self.block_s
        if not has_blocks:
            found.add("classes")
        if not has_blocks or self.classes == 1:
            found |= {"class_hard_w", "class_braking_w", "swing_share", "rise_share", "entry_share"}
        return found

    def place_s(self, trip_steps: int) -> int:
        """Length of a place for a trip of that many 1 s steps, 0 if there are no blocks.

        The trip has as many places as blocks. They stay where they are, to tell what the battery
        swings there (`qpmpc.preview.swing`); blocks with a length of their own are these places.
        """
        return -(-trip_steps // self.blocks) if self.blocks else self.block_s

    def edges(self, first: int, trip_steps: int) -> NDArray[np.intp]:
        """First second of each block beyond the short horizon, and the second after the last.

        With n blocks and r seconds left, block k begins

            max(min(floor(k r / n), r - (n - k) N), 0)   or, with a length b of their own,   k b

        from `first` or from departure, and no block begins before `first`. Blocks that have become
        as short as the short horizon thus stay where they are and pass one by one. A boundary never
        goes back and passes no more seconds than `first` does, so that a block hands its first
        seconds over to the one before it, and its slot goes on with nearly the same statistics.

        Parameters
        ----------
        first : second of the trip at which the short horizon ends
        trip_steps : of 1 s

        Returns
        -------
        shape (blocks + 1,)
        """
        k = np.arange(self.block_count(trip_steps) + 1)
        if not self.blocks:
            return np.clip(k * self.block_s, first, trip_steps)
        left = trip_steps - first
        shortest = left - (self.blocks - k) * self.short_stages
        return first + np.maximum(np.minimum(k * left // self.blocks, shortest), 0)

    def block_count(self, trip_steps: int) -> int:
        """Number of blocks for a trip of that many 1 s steps; the last may be empty.

        A number that is set holds for every trip, as in generated code.

        Raises
        ------
        InputError
            If `block_s` cuts the trip into more than `BLOCKS_MAX`.
        """
        if self.blocks:
            return self.blocks
        length_s = self.place_s(trip_steps)
        count = -(-trip_steps // length_s) if length_s else 0
        if count > BLOCKS_MAX:
            raise InputError(
                f"horizon.block_s={length_s} cuts a trip of {trip_steps} s into {count} blocks, at "
                f"most {BLOCKS_MAX} are allowed: set horizon.blocks, or a longer block_s"
            )
        return count

    def stage_count(self, trip_steps: int) -> int:
        """Number of stages, the same from departure to arrival."""
        return self.short_stages + self.classes * self.block_count(trip_steps)
