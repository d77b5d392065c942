"""From preview to stages: the data of the trip ahead that a QP needs, in fixed slots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.forecast import Trace, internal_off_w
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.vehicle.parameters import Vehicle

FIELDS = 4  # of `Stages`


@dataclass(frozen=True)
class Stages:
    """One horizon, stage by stage; shape (n,) each.

    A stage of duration 0 is masked: it passes the state on and costs nothing.

    Attributes
    ----------
    duration_s : h_k
    net_w : P0 = P_d + P_aux, mean over the stage
    speed_mps : mean speed
    internal_off_w : mean of the internal battery power l(P0) with the engine off; by convexity
        more than l of the mean, which an averaged preview (one class) has to use
    """

    duration_s: NDArray[np.float64]
    net_w: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    internal_off_w: NDArray[np.float64]


class StageBuilder:
    """Cuts a trip into stages at any time step.

    Slots are fixed from departure to arrival: the first N are the next N seconds, then each block
    of the trip has one slot per demand class, at its own absolute place. A block that has passed,
    or that the short horizon covers, has duration 0. So a long stage keeps its slot, and primal
    and dual variables can be carried from step to step by identity.

    The forecast is read at the time since departure and may be wrong about the trip's length. A
    trip that outlasts it goes on with the short horizon alone, and the terminal band then applies
    to its end; a trip that ends before it is planned to its end as soon as the short horizon
    reaches the arrival, and the rest of the forecast is masked.

    Parameters
    ----------
    vehicle : parameters
    truth : trace for the short horizon
    forecast : trace for the long horizon; its length sets the blocks
    settings : layout
    """

    def __init__(
        self, vehicle: Vehicle, truth: Trace, forecast: Trace, settings: HorizonSettings
    ) -> None:
        self.settings = settings
        self._vehicle = vehicle
        self.steps = truth.steps
        self._short = _fields(truth, vehicle)
        demand_class = _demand_class(forecast.demand_w, settings)
        self._cumulative = _cumulative(forecast, vehicle, demand_class, settings.classes)
        block_s = settings.block_length_s(forecast.steps)
        self.count = settings.stage_count(forecast.steps)
        start = np.arange(settings.block_count(forecast.steps)) * block_s
        self._block_start = np.minimum(start, forecast.steps)
        self._block_end = np.minimum(start + block_s, forecast.steps)

    def at(self, step: int) -> Stages:
        """Return the stages of the horizon that starts at time step `step`."""
        n_short = self.settings.short_stages
        seen = min(n_short, self.steps - step)
        fields = np.zeros((FIELDS, self.count))
        fields[:, :seen] = self._short[:, step : step + seen]
        arriving = step + n_short >= self.steps
        start = np.clip(step + seen, self._block_start, self._block_end)
        start = self._block_end if arriving else start
        # (classes, FIELDS, blocks) -> fields of the long stages, block by block, class by class
        sums = self._cumulative[:, :, self._block_end] - self._cumulative[:, :, start]
        duration = sums[:, 0].T.ravel()
        fields[0, n_short:] = duration
        fields[1:, n_short:] = sums[:, 1:].transpose(1, 2, 0).reshape(FIELDS - 1, -1)
        fields[1:, n_short:] /= np.maximum(duration, 1.0)
        if self.settings.classes == 1:  # an averaged preview has only the mean demand
            fields[3, n_short:] = internal_off_w(self._vehicle, fields[1, n_short:])
        return Stages(*fields)

    def shift(self) -> NDArray[np.intp]:
        """Slot in the previous step's solution from which each slot's warm start comes.

        Short stages move up by one and the last keeps its own values, which measured better than
        those of the long stage it leaves; long stages stay.
        """
        source = np.arange(self.count)
        source[: self.settings.short_stages - 1] += 1
        return source


def _fields(trace: Trace, vehicle: Vehicle) -> NDArray[np.float64]:
    """Duration, P0, speed and l(P0) of each 1 s step, in the order of `Stages`; (FIELDS, steps)."""
    return np.stack(
        [
            np.ones(trace.steps),
            trace.battery_side_w(vehicle),
            trace.speed_mps,
            trace.internal_off_w(vehicle),
        ]
    )


def _demand_class(demand_w: NDArray[np.float64], settings: HorizonSettings) -> NDArray[np.intp]:
    """Class of each step: 0 hard, 1 easy, 2 braking; all 0 with one class."""
    if settings.classes == 1:
        return np.zeros(len(demand_w), dtype=np.intp)
    easy_or_braking = np.where(demand_w < settings.class_braking_w, 2, 1)
    return np.where(demand_w > settings.class_hard_w, 0, easy_or_braking).astype(np.intp)


def _cumulative(
    forecast: Trace, vehicle: Vehicle, demand_class: NDArray[np.intp], classes: int
) -> NDArray[np.float64]:
    """Running sums over time of duration, P0, speed and l(P0), separately for each class.

    Returns
    -------
    shape (classes, FIELDS, steps + 1)
    """
    fields = _fields(forecast, vehicle)
    member = demand_class == np.arange(classes)[:, None]
    sums = np.zeros((classes, FIELDS, forecast.steps + 1))
    np.cumsum(fields[None] * member[:, None], axis=2, out=sums[:, :, 1:])
    return sums
