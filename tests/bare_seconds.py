"""Seconds of nothing but a demand, for the rules that decide on the coming one."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from qpmpc.preview.stages import Stages
from qpmpc.pwa.priced import Going
from qpmpc.qp.polish import Polish, Prices


class Second(NamedTuple):
    """One second with the engine on; as of `Going`."""

    power_w: float
    gain_w: float
    dearer_g_per_s: float


def second(polish: Polish, prices: Prices, net_w: float) -> Second:
    """Return one second of this net power."""
    found = polish.going(prices, np.array([net_w]), np.array([polish.internal_w(net_w)]))
    return Second(*(float(each[0]) for each in found))


def going(polish: Polish, prices: Prices, stages: Stages, seconds: int) -> Going:
    """Return the first seconds of a horizon."""
    return polish.going(prices, stages.net_w[:seconds], stages.internal_off_w[:seconds])


def bare_stages(
    polish: Polish,
    net_w: Sequence[float],
    must: Collection[int] = (),
    seconds: int | None = None,
    speed_mps: float = 8.0,
) -> Stages:
    """Return stages of a second each, masked after so many; those of `must` have to run."""
    count = len(net_w)
    off_w = np.array([polish.internal_w(w) for w in net_w])
    zero = np.zeros(count)
    must_share = np.isin(np.arange(count), list(must)).astype(float)
    h = (np.arange(count) < (count if seconds is None else seconds)).astype(float)
    return Stages(
        h, np.array(net_w), zero + speed_mps, off_w, must_share, zero, off_w, zero, zero, zero
    )
