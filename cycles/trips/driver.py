"""A driver who goes uphill as fast as a modest car can."""

import math
from itertools import pairwise

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.trips.hills import SPACING_M

POWER_WPKG = 22.0
"""Largest ``v (a + g grade)``: just above the 21 W/kg of the WLTC. Of the shipped cars
(1531 kg, drag of 21 kW at 130 km/h, 0.88 from engine to wheel) it takes at most 63 kW, below the
71 kW of their engine without help from the battery."""

GRAVITY_MPS2 = 9.81
CATCH_UP_MPS2 = 1.5


def drive(wanted_mps: Floats, grade: Floats) -> Floats:
    """Follow the wanted speed as far as the power allows.

    Parameters
    ----------
    wanted_mps : speed at whole seconds on a level road, shape (n+1,)
    grade : at points `SPACING_M` apart, from the start of the trip

    Returns
    -------
    speed at whole seconds, nowhere above the wanted, shape (n+1,)
    """
    wanted, slopes = wanted_mps.tolist(), np.append(grade, grade[-1]).tolist()
    last = len(slopes) - 1
    speed = [wanted[0]]
    way, v = 0.0, wanted[0]
    for before, now in pairwise(wanted):
        here = slopes[min(int(way / SPACING_M), last)]
        ahead = slopes[min(int((way + v) / SPACING_M) + 1, last)]
        pull = GRAVITY_MPS2 * max(here, ahead)
        # (v + s)/2 (s - v + pull) = P, solved for the next speed s
        most = math.sqrt(pull * pull / 4.0 + 2.0 * POWER_WPKG + v * v - v * pull) - pull / 2.0
        following = now if v == before else min(now, v + max(CATCH_UP_MPS2, now - before))
        new = max(min(following, most), 0.0)
        way += (v + new) / 2.0
        v = new
        speed.append(new)
    return np.asarray(speed)
