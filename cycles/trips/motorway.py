"""Motorway stretches: entry, cruise at changing targets, slowdowns, exit."""

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.trips.draws import Draws
from qpmpc.cycles.trips.micro_trips import NOISE_MOST, slow_noise

SHORTEST_S = 180
TARGET_MPS = (80.0 / 3.6, 130.0 / 3.6)
TARGET_CHANGE_MPS = 5.0  # sd of a new target about the old one
TARGET_S = (60.0, 300.0)
SLOWDOWN_SHARE = 0.2  # of the targets end in one
SLOWDOWN_MPS, SLOWDOWN_S = (4.0, 16.0), (15.0, 60.0)
FLUCTUATION_MPS, FLUCTUATION_POLE = (0.5, 1.0), 0.93  # correlated over some 30 s
ENTRY_MPS2, ENTRY_WPKG = 1.5, 13.0  # acceleration, and v a
RESPONSE_S = 8.0  # time constant towards a new target
ACCEL_MPS2, BRAKE_MPS2 = 0.7, 1.2
EXIT_MPS2 = (0.7, 1.1)
SMOOTHING_S = 7


def motorway(draws: Draws, steps: int) -> Floats:
    """Draw a stretch of `steps` seconds, from rest to rest, speed at whole seconds in m/s."""
    target = _targets(draws, steps + 1)
    noise = np.clip(slow_noise(draws, steps + 1, FLUCTUATION_POLE), -NOISE_MOST, NOISE_MOST)
    fluctuation = draws.uniform(*FLUCTUATION_MPS) * noise
    speed = [0.0]
    for wanted in target[1:].tolist():
        v = speed[-1]
        entering = v < TARGET_MPS[0] - 2.0
        most = min(ENTRY_MPS2, ENTRY_WPKG / max(v, 1.0)) if entering else ACCEL_MPS2
        speed.append(v + min(max((wanted - v) / RESPONSE_S, -BRAKE_MPS2), most))
    moving = np.asarray(speed)
    moving = np.maximum(moving + fluctuation * np.minimum(moving / TARGET_MPS[0], 1.0) ** 2, 0.0)
    to_end = np.arange(float(steps), -1.0, -1.0)
    moving = np.minimum(moving, draws.uniform(*EXIT_MPS2) * to_end)
    window = np.hanning(SMOOTHING_S + 2)[1:-1]
    smooth = np.convolve(moving, window / window.sum(), "same")
    ends = np.minimum(np.arange(steps + 1.0), to_end) < SMOOTHING_S
    return np.where(ends, np.minimum(smooth, moving), smooth)


def _targets(draws: Draws, count: int) -> Floats:
    target = np.empty(count)
    base = draws.uniform(*TARGET_MPS)
    at = 0
    while at < count:
        held = int(draws.uniform(*TARGET_S))
        target[at : at + held] = base
        at += held
        if draws.uniform() < SLOWDOWN_SHARE:
            slow = int(draws.uniform(*SLOWDOWN_S))
            target[at : at + slow] = base - draws.uniform(*SLOWDOWN_MPS)
            at += slow
        base += TARGET_CHANGE_MPS * float(draws.normals(1)[0])
        base = min(max(base, TARGET_MPS[0]), TARGET_MPS[1])
    return target
