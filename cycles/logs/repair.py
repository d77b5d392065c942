"""What loggers do to good samples: noise while standing, stamps that repeat."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.columns import LEFT_OUT, REPAIRED, LogColumns, Said
from qpmpc.errors import InputError

NOISE_MPS = 0.05
"""Of a speed sensor while the car stands."""

AGAIN_MAX = 0.05
"""Share of rows that may repeat the time of the row before, as where a logger hiccups."""


SPREAD_MIN = 5
"""Stamps with equally many rows that show that there is a rule."""


def repaired(path: Path, log: LogColumns) -> LogColumns:
    """Take noise of a standing car for 0; repair stamps that repeat.

    A few repeated stamps are left out. Where each stamp is there equally often, as in rows at 10 Hz
    with times in whole seconds, the rows are spread evenly; the first and the last stamp may have
    fewer.

    Raises
    ------
    InputError
        If many stamps repeat, but not equally often.
    """
    noise = (log.speed_mps < 0.0) & (log.speed_mps > -NOISE_MPS)
    if np.any(noise):
        text = f"{int(np.sum(noise))} speeds between -{NOISE_MPS:g} and 0 m/s taken for 0"
        log = replace(log, speed_mps=np.where(noise, 0.0, log.speed_mps)).also(Said(REPAIRED, text))
    again = np.append(False, np.diff(log.time_s) == 0.0)
    share = float(np.mean(again))
    if share > AGAIN_MAX:
        return _spread(path, log, int(np.argmax(again)), share)
    if np.any(again):
        text = f"{int(np.sum(again))} rows with the time of the row before left out"
        return log.taken(~again, Said(LEFT_OUT, text))
    return log


def _spread(path: Path, log: LogColumns, first: int, share: float) -> LogColumns:
    """Spread rows that share a stamp over the time to the next stamp."""
    begins = np.flatnonzero(np.append(True, np.diff(log.time_s) != 0.0))
    counts = np.diff(np.append(begins, len(log.time_s)))
    stamps: Floats = log.time_s[begins]
    inner = counts[1:-1]
    if not (
        len(inner) >= SPREAD_MIN
        and np.all(inner == inner[0])
        and max(counts[0], counts[-1]) <= inner[0]
        and np.all(np.diff(stamps) > 0.0)
    ):
        raise InputError(
            f"{path}, {log.row} {log.rows[first]}: {share:.0%} of the rows have the time of the "
            "row before, but not each time equally often: time must increase strictly; give it "
            "with decimals"
        )
    most = int(inner[0])
    period_s = float(np.median(np.diff(stamps)))
    within = np.arange(len(log.time_s)) - np.repeat(begins, counts)
    within[: counts[0]] += most - counts[0]  # the log begins in the middle of a stamp
    text = f"each time is there in {most} rows: spread evenly, {period_s / most:.3g} s apart"
    time_s = log.time_s + within * (period_s / most)
    return replace(log, time_s=time_s).also(Said(REPAIRED, text))
