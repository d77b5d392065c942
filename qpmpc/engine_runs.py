"""Runs of the engine from its start to its stop: how many, how long, what their starts take."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.engine_parameters import Engine

SHORT_S = 3  # shorter ones are shown: no engine is started for so little


def ended_runs_s(engine_on: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Length of each run of the engine that ended before arrival, shape (runs,).

    One that arrival cuts off is left out: it would have gone on. The engine is off at departure.

    Parameters
    ----------
    engine_on : second by second, shape (steps,)
    """
    begins, ends = _changes(engine_on)
    return np.asarray(ends - begins[: len(ends)])


def _changes(engine_on: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Seconds in which the engine is started, and in which it is stopped."""
    changes = np.diff(np.asarray(engine_on, dtype=np.int64), prepend=0)
    return np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)


def run_figures(engine: Engine, engine_on: NDArray[np.bool_], distance_km: float) -> dict[str, Any]:
    """Return the figures of starts and runs, by their names in the JSON of a run.

    Figures that need a run that ended, or a distance, are null without one.
    """
    starts = len(_changes(engine_on)[0])
    runs = ended_runs_s(engine_on)
    ended = len(runs) > 0
    return {
        "engine_starts_per_km": starts / distance_km if distance_km > 0.0 else None,
        "engine_on_s": {
            "min": int(runs.min()) if ended else None,
            "median": float(np.median(runs)) if ended else None,
        },
        "engine_runs_below_3s_share": float((runs < SHORT_S).mean()) if ended else None,
        "engine_runs_below_min_on_s": int((runs < engine.min_on_s).sum()),
        "fuel_starts_g": starts * engine.start_fuel_g,
    }
