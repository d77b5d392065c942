"""What a log has of a drive, in SI units, whatever file it comes from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles.cycle import Floats

READ, ASSUMED, REPAIRED, LEFT_OUT, UNUSUAL = "read", "assumed", "repaired", "left out", "unusual"


class Said(NamedTuple):
    """One line about a file, and what kind of thing was done or noticed."""

    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class LogColumns:
    """Samples of a drive.

    Attributes
    ----------
    rows : number of each sample in the file
    time_s, speed_mps : shape (m,)
    grade : rise over run, shape (m,); None where the file has none
    elevation_m : shape (m,), NaN where a sample has none; None where the file has none
    trips : to which trip each sample belongs, shape (m,); None where the file names none
    said : what was assumed, repaired and left out
    row : what the file calls a sample: a line, a point
    """

    rows: Sequence[int]
    time_s: Floats
    speed_mps: Floats
    grade: Floats | None = None
    elevation_m: Floats | None = None
    trips: tuple[str, ...] | None = None
    said: tuple[Said, ...] = ()
    row: str = "line"

    def taken(self, kept: NDArray[np.intp] | NDArray[np.bool_], *said: Said) -> "LogColumns":
        """Return these samples only, and one thing more that is said."""
        chosen = np.arange(len(self.time_s))[kept].tolist()
        return replace(
            self,
            rows=[self.rows[k] for k in chosen],
            time_s=self.time_s[chosen],
            speed_mps=self.speed_mps[chosen],
            grade=None if self.grade is None else self.grade[chosen],
            elevation_m=None if self.elevation_m is None else self.elevation_m[chosen],
            trips=None if self.trips is None else tuple(self.trips[k] for k in chosen),
            said=(*self.said, *said),
        )

    def also(self, *said: Said) -> "LogColumns":
        """Return the same samples, and something more that is said."""
        return replace(self, said=(*self.said, *said))
