"""What a faulty signal or preview looks like to the controller."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from qpmpc.faults.models import Fault
from qpmpc.preview.stages import Preview, Stages

WILD_W, WILD_MPS, WILD_SHARE, WILD_S, WILD_J = 1e6, 300.0, 9.0, 1e4, 1e9


def altered_signal(fault: Fault, second: int, history: list[Any]) -> Any:
    """Return what a faulty signal shows.

    Parameters
    ----------
    second : of the fault
    history : the signal at departure and in each second since, the present one last
    """
    now, value = history[-1], fault.value or 0.0
    shown: Any = now
    if fault.kind == "nan":
        shown = float("nan")
    elif fault.kind == "offset":
        shown = now + value
    elif fault.kind == "drift":
        shown = now + value * (second - fault.at_s + 1)
    elif fault.kind == "stuck":
        shown = history[fault.at_s]
    elif fault.kind == "jump":
        shown = value
    elif fault.kind == "delay":
        shown = history[max(second - int(value), 0)]
    return type(now)(shown)


def altered_preview(fault: Fault, second: int, first: Preview, now: Preview) -> Preview:
    """Return the preview that arrives in place of the right one.

    Parameters
    ----------
    second : of the fault
    first, now : the right ones when the fault began, and of the second
    """
    value = int(fault.value or 0)
    if fault.kind == "missing":
        return _missing(now)
    if fault.kind == "stale":
        return first
    if fault.kind == "wild":
        return _wild(now, second)
    return _too_short(now, value) if fault.kind == "too-short" else _too_long(now, value)


def _missing(now: Preview) -> Preview:
    """Return an empty message: nothing is driven."""
    short, long = np.zeros_like(now.short_demand_w), np.zeros_like(now.long.duration_s)
    return Preview(short, short.copy(), 0, Stages(*np.zeros((len(fields(Stages)), len(long)))), 0.0)


def _wild(now: Preview, second: int) -> Preview:
    """Return numbers that are finite and absurd, others in each second and the same in each run."""
    rng = np.random.default_rng(second)
    short, long = now.short_demand_w.shape, now.long.duration_s.shape
    return Preview(
        rng.uniform(-WILD_W, WILD_W, short),
        rng.uniform(0.0, WILD_MPS, short),
        now.short_count,
        Stages(
            rng.uniform(0.0, WILD_S, long),
            rng.uniform(-WILD_W, WILD_W, long),
            rng.uniform(0.0, WILD_MPS, long),
            rng.uniform(-WILD_W, WILD_W, long),
            rng.uniform(0.0, WILD_SHARE, long),
            rng.uniform(-WILD_W, WILD_W, long),
            rng.uniform(-WILD_W, WILD_W, long),
            rng.uniform(0.0, WILD_S, long),
            rng.uniform(0.0, WILD_J, long),
            rng.uniform(0.0, WILD_J, long),
        ),
        float(rng.uniform(0.0, WILD_J)),
    )


def _too_short(now: Preview, early_s: int) -> Preview:
    """Take time off the end: first from the last blocks, then from the coming seconds."""
    duration_s = now.long.duration_s
    before_s = np.concatenate([[0.0], np.cumsum(duration_s)])
    kept_s = max(float(before_s[-1]) - early_s, 0.0)
    left = np.clip(kept_s - before_s[:-1], 0.0, duration_s)
    count = max(now.short_count - max(early_s - round(float(before_s[-1])), 0), 0)
    return now._replace(short_count=count, long=_lasting(now.long, left))


def _too_long(now: Preview, late_s: int) -> Preview:
    """Add time: the blocks ahead last longer in proportion; after the last the car stands."""
    total_s = float(now.long.duration_s.sum())
    if total_s > 0.0:
        factor = (total_s + late_s) / total_s
        return now._replace(long=_lasting(now.long, now.long.duration_s * factor))
    return now._replace(short_count=min(now.short_count + late_s, len(now.short_demand_w)))


def _lasting(long: Stages, duration_s: np.ndarray[Any, np.dtype[np.float64]]) -> Stages:
    return replace(long, duration_s=duration_s)
