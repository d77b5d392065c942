"""Where on its route a car is in a forecast of the trip: by the way that it has driven.

A forecast made before departure is early or late after some minutes. A navigation system knows the
place, whatever the clock says, so the long horizon goes on from there.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.forecast import Trace

ANOTHER_ROUTE = 0.1  # of the way: a forecast that is off by more is said to be

CATCH_UP = 2
"""Seconds of a forecast that may pass in one: more would look like another route."""


def forecast_seconds(truth: Trace, forecast: Trace) -> NDArray[np.intp]:
    """Return the second of the forecast at the place where the car is in each second.

    While it moves that is the first second in which the forecast has covered the same share of its
    way, but not before the last one and at most `CATCH_UP` after it; while it stands the forecast's
    time runs on. A true forecast is read by the clock, and so is a trip without a way.

    Parameters
    ----------
    truth : driven
    forecast : of the same route

    Returns
    -------
    shape (truth.steps + 1,), from 0 on, at most forecast.steps
    """
    driven = np.concatenate([[0.0], np.cumsum(truth.speed_mps)])
    expected = np.concatenate([[0.0], np.cumsum(forecast.speed_mps)])
    seconds = np.arange(truth.steps + 1)
    if not (driven[-1] > 0.0 and expected[-1] > 0.0):
        return np.minimum(seconds, forecast.steps)
    driven, expected = driven / driven[-1], expected / expected[-1]
    there = np.minimum(np.searchsorted(expected, driven), forecast.steps)
    second = 0
    for k in seconds[1:].tolist():
        moves = driven[k] > driven[k - 1]
        wanted = int(there[k]) if moves else second + 1
        second = min(max(wanted, second), second + CATCH_UP, forecast.steps)
        seconds[k] = second
    return seconds


def remark(truth: Trace, forecast: Trace) -> str:
    """Say how a forecast is read whose way has another length; empty if it has the same."""
    way_km, expected_km = (1e-3 * float(of.speed_mps.sum()) for of in (truth, forecast))
    if abs(expected_km - way_km) <= ANOTHER_ROUTE * way_km:
        return ""
    how = "by the share of its way driven" if min(way_km, expected_km) > 0.0 else "by the clock"
    return f"the forecast has {expected_km:.3g} km, the trip {way_km:.3g} km: it is read {how}"
