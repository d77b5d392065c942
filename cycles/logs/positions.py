"""Speed from positions: smoothed east and north, then their rate of change.

The length of the filter is a choice between noise and acceleration. Three shipped cycles and three
`train` trips on a winding road, with noise of the positions east and north of correlation time T
in s, and white noise w in m on it: error of the speed in m/s, of the way in %, and of the kinetic
energy of all accelerations in %:

    deviation of the filter, s           1                  1.5                  2
    no noise                      0.15 -0.1  -5      0.24 -0.1  -8      0.34 -0.1 -11
    3 m, T = 60, w = 0.1          0.33 +0.9 +16      0.34 +0.6  +2      0.40 +0.4  -6
    3 m, T = 60, w = 1            0.47 +1.6 +50      0.40 +1.0 +13      0.42 +0.6  -2
    2 m, T = 10, w = 0.05         0.47 +1.6 +36      0.43 +1.1 +13      0.45 +0.8  +1

Cubics over 7 to 11 points (Savitzky-Golay) have up to +43 % of kinetic energy in the second case.
"""

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.smooth import smoothed
from qpmpc.cycles.plausibility import GAP_MAX_S

EARTH_M = 6_371_008.8
"""Mean radius (IUGG): distances on the ellipsoid differ by up to 0.5 %."""

SMOOTH_S = 1.5
STANDING_MPS = 0.3
"""Below it the positions of a standing car drift."""


def speed_from_positions(time_s: Floats, lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, str]:
    """Speed of a car at its positions.

    ``dn = R dlat, de = R cos(lat) dlon`` from point to point; n and e at whole seconds are
    smoothed by a Gaussian of `SMOOTH_S`, ``v = |(dn, de)/dt|``. Smoothed before the root, since the
    noise of a distance is never negative and would make the way longer. Over more than `GAP_MAX_S`
    without a point nothing is smoothed.

    Parameters
    ----------
    time_s, lat_deg, lon_deg : shape (m,)

    Returns
    -------
    speed_mps : shape (m,)
    how : what was done, in a line
    """
    lat, lon = np.radians(lat_deg), np.unwrap(np.radians(lon_deg))
    middle = (lat[:-1] + lat[1:]) / 2
    north_m = EARTH_M * np.concatenate([[0.0], np.cumsum(np.diff(lat))])
    east_m = EARTH_M * np.concatenate([[0.0], np.cumsum(np.cos(middle) * np.diff(lon))])
    step_s = np.diff(time_s)
    cuts = np.flatnonzero((step_s > GAP_MAX_S) | (step_s < 0.0)) + 1
    speed = np.concatenate(
        [
            _speed(time_s[part], north_m[part], east_m[part])
            for part in np.split(np.arange(len(time_s)), cuts)
        ]
    )
    standing = speed < STANDING_MPS
    how = (
        f"speed from positions, Gaussian filter of {SMOOTH_S:g} s, below {STANDING_MPS:g} m/s "
        "taken for 0"
    )
    return np.where(standing, 0.0, speed), how


def _speed(time_s: Floats, north_m: Floats, east_m: Floats) -> Floats:
    """Speed along one part without gaps."""
    elapsed = time_s - time_s[0]
    grid = np.arange(np.ceil(elapsed[-1]) + 1.0)
    if len(grid) < 3:
        return np.zeros(len(time_s))
    rates = [
        np.gradient(smoothed(np.interp(grid, elapsed, part_m), SMOOTH_S))
        for part_m in (north_m, east_m)
    ]
    speed: Floats = np.interp(elapsed, grid, np.hypot(*rates))
    return speed
