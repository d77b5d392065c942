"""What all groups of a vehicle's parameters share: strictness, arrays, the plant's step."""

from itertools import pairwise
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Celsius = Annotated[float, Field(ge=-100.0, le=150.0)]
# Most entries of an array; a measured map has tens.
POINTS_MAX = 1000
# Not strict: TOML's arrays are lists. Their entries are.
ARRAY = Field(min_length=2, max_length=POINTS_MAX, strict=False)

STEP_S = 1.0  # of plant and controllers: nothing may empty, heat or cool down within one
SPEED_MAX_MPS = 70.0  # at which forces and losses are checked


class Section(BaseModel):
    """A group of parameters: no unknown keys, only finite numbers, no change after loading.

    Strict, because otherwise pydantic takes true for 1 and "2" for 2.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def require_increasing(name: str, values: tuple[float, ...], least: float) -> None:
    """Raise a ValueError unless each value is above the one before by `least`."""
    if any(b - a < least for a, b in pairwise(values)):
        raise ValueError(f"{name} must increase from entry to entry, by {least:g} or more")


def require_same_length(grid: tuple[float, ...], **tables: tuple[float, ...]) -> None:
    """Raise a ValueError unless each table has an entry per grid point."""
    for name, table in tables.items():
        if len(table) != len(grid):
            raise ValueError(f"{name} must have {len(grid)} entries, one per grid point")
