"""Grade over the way: two first-order processes, smooth, and no steeper than the road allows."""

import math

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.trips.draws import Draws
from qpmpc.cycles.trips.micro_trips import CITY, MOTORWAY, RURAL, SUBURB

TERRAINS = ("flat", "rolling", "hilly")
SHARES = (0.4, 0.4, 0.2)
GRADE_SD = {"flat": (0.002, 0.007), "rolling": (0.010, 0.020), "hilly": (0.022, 0.035)}
"""Standard deviation of the grade, drawn per trip; assumed."""

STEEPEST = {CITY: 0.08, SUBURB: 0.08, RURAL: 0.06, MOTORWAY: 0.04}
"""Usual design limits of roads."""

LENGTH_M = ((250.0, 600.0), (1500.0, 4000.0))
"""Correlation lengths of the two processes: crests and dips, and hills."""

LONG_SHARE = 0.4  # of the variance is that of the longer
SPACING_M = 20.0
SHORTEST_WAVE_M = 200.0
"""First null of the smoothing window; shorter waves are at least 31 dB down."""

_HALF = int(SHORTEST_WAVE_M / SPACING_M)
_WINDOW = np.hanning(2 * _HALF + 1)[1:-1] / np.hanning(2 * _HALF + 1).sum()


def terrain(quantile: float) -> str:
    """Terrain at a quantile, 0..1."""
    return TERRAINS[int(np.searchsorted(np.cumsum(SHARES)[:-1], quantile, side="right"))]


def hills(draws: Draws, ground: str, steepest: Floats) -> Floats:
    """Draw the grade at points `SPACING_M` apart.

    ``g = (c tanh(h / c)) * w``: h has the autocovariance
    ``s^2 (0.6 exp(-|x|/l1) + 0.4 exp(-|x|/l2))``, c is the steepest grade allowed within a
    half-width of the smoothing window w, so that g keeps below the limit of each place.

    Parameters
    ----------
    draws : source of randomness
    ground : one of `TERRAINS`
    steepest : limit of |grade| at each point, shape (n,)

    Returns
    -------
    rise over run, shape (n,)
    """
    from scipy.signal import lfilter  # here: importing it takes a second

    margin = len(_WINDOW) // 2
    count = len(steepest) + 2 * margin
    sd = draws.uniform(*GRADE_SD[ground])
    rough = np.zeros(count)
    variance = 0.0
    for share, lengths in zip((1.0 - LONG_SHARE, LONG_SHARE), LENGTH_M, strict=True):
        length = lengths[0] * (lengths[1] / lengths[0]) ** draws.uniform()
        pole = math.exp(-SPACING_M / length)
        white = draws.normals(count + 1)
        start = pole * white[0]
        noise = math.sqrt(1.0 - pole * pole) * white[1:]
        process, _ = lfilter([1.0], [1.0, -pole], noise, zi=[start])
        rough += math.sqrt(share) * process
        lags = np.abs(np.subtract.outer(np.arange(len(_WINDOW)), np.arange(len(_WINDOW))))
        variance += share * float(_WINDOW @ pole**lags @ _WINDOW)
    rough *= sd / math.sqrt(variance)
    padded = np.pad(steepest, 2 * margin, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, len(_WINDOW)).min(axis=1)
    return np.convolve(around * np.tanh(rough / around), _WINDOW, "valid")
