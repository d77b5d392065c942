"""Where a car stands and where it drives."""

from itertools import pairwise

import numpy as np

from qpmpc.cycles.cycle import Floats


def phases(speed_mps: Floats) -> list[tuple[int, int, bool]]:
    """Sequences of points that stand or drive: (first, one after the last, standing)."""
    standing = speed_mps <= 0.0
    edges = [0, *(np.flatnonzero(np.diff(standing)) + 1).tolist(), len(standing)]
    return [(a, b, bool(standing[a])) for a, b in pairwise(edges)]
