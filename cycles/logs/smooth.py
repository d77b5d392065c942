"""A Gaussian filter that keeps straight lines, up to both ends."""

import numpy as np

from qpmpc.cycles.cycle import Floats

CUT = 4.0
"""Standard deviations on either side that count."""


def smoothed(values: Floats, deviation: float) -> Floats:
    """Smooth evenly spaced values with a Gaussian kernel.

    Beyond the ends the values are continued by reflection in the first and the last point, so that
    a straight line stays one.

    Parameters
    ----------
    values : shape (n,)
    deviation : standard deviation of the kernel, in spacings

    Returns
    -------
    shape (n,)
    """
    half = min(int(np.ceil(CUT * deviation)), len(values) - 1)
    if half < 1:
        return values
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / deviation) ** 2)
    padded = np.pad(values, half, mode="reflect", reflect_type="odd")
    return np.convolve(padded, kernel / kernel.sum(), mode="valid")
