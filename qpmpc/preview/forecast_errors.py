"""Wrong forecasts: seeded error models of the trip beyond the short horizon.

Each model turns the true trip into another one, as a `Cycle`; `forecast` makes the demand and
speed `Trace` of it for the long horizon. The short horizon always has the true trip.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from qpmpc.cycles import Cycle
from qpmpc.cycles.standstill import phases
from qpmpc.errors import InputError
from qpmpc.names import unknown
from qpmpc.preview.forecast import Trace
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]
Model = Callable[[Cycle, np.random.Generator], Cycle]

NOISE_SHARE, NOISE_CORRELATION_S = 0.15, 20.0
STRETCH_SHARE = 0.05
SHIFT_S = 10.0
STOP_SPREAD = 0.5
SEED_DIGITS = 18
BURN_IN = 10  # correlation times after which the noise no longer depends on its start


def speed_noise(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """Speed off by a correlated share: v' = v (1 + n), not below 0.

    n is Gaussian with standard deviation 0.15 and the autocorrelation (1 + t/c) exp(-t/c), whose
    integral, the correlation time, is 2 c = 20 s. That is AR(1) noise smoothed once more: plain
    AR(1) noise of speed is rough, and no driver accelerates like that (1.4 m/s^2 rms at 30 m/s).
    Stops stay stops.
    """
    from scipy.signal import lfilter  # here: importing it takes a second

    pole = float(np.exp(-2.0 / NOISE_CORRELATION_S))
    burn_in = int(BURN_IN * NOISE_CORRELATION_S)
    white = rng.standard_normal(burn_in + len(cycle.speed_mps))
    smooth = lfilter([1.0], [1.0, -2.0 * pole, pole * pole], white)[burn_in:]
    deviation = np.sqrt((1.0 + pole**2) / (1.0 - pole**2) ** 3)  # of the filter's output
    factor = np.maximum(1.0 + NOISE_SHARE * smooth / deviation, 0.0)
    return Cycle(cycle.name, cycle.time_s, cycle.speed_mps * factor, cycle.grade)


def travel_time_stretch(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """The whole trip slower or faster: t' = f t, v' = v / f, f lognormal with 5 %; same distance.

    The last second is cut or filled up to a whole one.
    """
    factor = float(np.exp(STRETCH_SHARE * rng.standard_normal()))
    steps = max(round(cycle.steps * factor), 1)
    time_s = np.arange(steps + 1.0)
    speed = np.interp(time_s / factor, cycle.time_s, cycle.speed_mps) / factor
    grade = np.interp(time_s / factor, cycle.time_s, cycle.grade)
    return Cycle(cycle.name, time_s, speed, grade)


def shift(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """Everything later or earlier by some seconds, normal with 10 s.

    Late, the trip begins with a wait at its first speed; early, its first seconds are missing.
    """
    most = cycle.steps // 2
    late = int(np.clip(round(SHIFT_S * rng.standard_normal()), -most, most))
    index = np.maximum(np.arange(len(cycle.time_s) + late) - max(late, 0), 0) + max(-late, 0)
    return _at(cycle, index)


def stop_durations(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """Each stop longer or shorter by its own lognormal factor, spread 0.5, at least 1 s."""
    pieces = []
    for start, end, standing in phases(cycle.speed_mps):
        if standing:
            factor = np.exp(STOP_SPREAD * rng.standard_normal())
            pieces.append(np.full(max(round((end - start) * factor), 1), start))
        else:
            pieces.append(np.arange(start, end))
    index = np.concatenate(pieces)
    return _at(cycle, index if len(index) > 1 else np.arange(len(cycle.time_s)))


def another_day(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """The trip's micro-trips in random order: right in sum, wrong in place.

    A micro-trip is a drive and the stop after it. A trip without stops is a single micro-trip and
    stays unchanged.
    """
    driving = [start for start, _, standing in phases(cycle.speed_mps) if not standing]
    if not driving:
        return cycle
    bounds = [*driving, len(cycle.speed_mps)]
    trips = [np.arange(a, b) for a, b in pairwise(bounds)]
    order = rng.permutation(len(trips))
    return _at(cycle, np.concatenate([np.arange(driving[0]), *(trips[i] for i in order)]))


def combined(cycle: Cycle, rng: np.random.Generator) -> Cycle:
    """Wrong stops, stretch, shift and speed noise at once."""
    for model in (stop_durations, travel_time_stretch, shift, speed_noise):
        cycle = model(cycle, rng)
    return cycle


MODELS: dict[str, Model] = {
    "speed noise": speed_noise,
    "travel time": travel_time_stretch,
    "shift": shift,
    "stops": stop_durations,
    "another day": another_day,
    "combined": combined,
}


def parse_forecast(text: str) -> tuple[str, int]:
    """Split ``MODEL[:SEED]``; the seed is 0 if there is none.

    Raises
    ------
    InputError
        If there is no such model, or the seed is no integer from 0 on.
    """
    model, colon, seed = text.partition(":")
    if model not in MODELS:
        raise InputError(unknown("forecast error", model, MODELS))
    if colon and not (seed.isascii() and seed.isdecimal() and len(seed) <= SEED_DIGITS):
        raise InputError(f"forecast {text!r}: the seed must be an integer, 0 or more")
    return model, int(seed or 0)


def forecast(cycle: Cycle, vehicle: Vehicle, model: str, seed: int) -> Trace:
    """Make a wrong forecast of a trip; its length may differ from the trip's.

    Parameters
    ----------
    cycle : the true trip
    vehicle : its demand is forecast
    model : one of `MODELS`
    seed : equal seeds give equal forecasts

    Raises
    ------
    InputError
        If there is no such model.
    """
    if model not in MODELS:
        raise InputError(unknown("forecast error", model, MODELS))
    rng = np.random.default_rng([list(MODELS).index(model), seed])
    return Trace.of(MODELS[model](cycle, rng), vehicle)


def _at(cycle: Cycle, index: NDArray[np.intp]) -> Cycle:
    """The cycle's points in another order or number."""
    time_s = np.arange(float(len(index)))
    return Cycle(cycle.name, time_s, cycle.speed_mps[index], cycle.grade[index])
