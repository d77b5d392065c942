"""From preview to stages: the data of the trip ahead that a QP needs, in fixed slots."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.forecast import Trace, internal_off_w
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.place import forecast_seconds
from qpmpc.preview.swing import LEAST_KEPT_J, NO_LIMIT_J, drops, rooms, swings, uses
from qpmpc.vehicle.must_run import begun_s, must_run, too_fast, whole_runs
from qpmpc.vehicle.parameters import Vehicle

LEAST_SHARE = 1e-6  # of a second in a day: below it is rounding
FIELDS = 7  # of `Stages` that are means or sums of seconds
OF_FREE = slice(5, 7)  # P0 and l(P0) of the seconds that leave a choice
OF_ALL = [1, 3]  # the same of all seconds


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
    must_share : share of its seconds in which the engine must run (`qpmpc.vehicle.must_run`), in a
        block also of those in which it does because it had to start just before (`whole_runs`)
    free_net_w, free_internal_off_w : means of P0 and l(P0) over the other seconds, in which the
        engine may be off; of a stage without such seconds those of all
    rises : r_k, starts of the engine in the stage per on-share that it has more than the stage
        before: u_k >= r_k (sigma_k - sigma_k-1)
    fall_j, rise_j : energy that SOC keeps from its lower and its upper limit at the stage's end,
        see `qpmpc.preview.swing`: more than 0 at the end of a block ahead, 0 for 1 s but for the
        rise of the last before the blocks, -NO_LIMIT_J inside a block, where it is not limited
    """

    duration_s: NDArray[np.float64]
    net_w: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    internal_off_w: NDArray[np.float64]
    must_share: NDArray[np.float64]
    free_net_w: NDArray[np.float64]
    free_internal_off_w: NDArray[np.float64]
    rises: NDArray[np.float64]
    fall_j: NDArray[np.float64]
    rise_j: NDArray[np.float64]

    @property
    def refill_j(self) -> NDArray[np.float64]:
        """Energy that the road beyond each block puts into the battery by itself, J; shape (n,).

        With b+1 the block after b, and l from its statistics,

            R_b = max(R_b+1 - sum of h l over block b+1, 0)

        0 at the last block, for seconds, and inside blocks.
        """
        spent_j = self.duration_s * self.internal_off_w
        ends = np.flatnonzero(self.fall_j > 0.0)
        found, after_j = np.zeros(len(spent_j)), 0.0
        for end, following in zip(ends[-2::-1], ends[:0:-1], strict=True):
            after_j = max(after_j - float(spent_j[end + 1 : following + 1].sum()), 0.0)
            found[end] = after_j
        return found

    @property
    def must_s(self) -> float:
        """Seconds ahead in which the engine must run."""
        return float((self.duration_s * self.must_share).sum())

    def arrival_s(self, short_stages: int) -> int | None:
        """Seconds until arrival, None where that is beyond the first `short_stages` of 1 s."""
        count = len(self.seconds_w(short_stages))
        return count if count < short_stages else None

    def fast_s(self, short_stages: int, vehicle: Vehicle) -> int | None:
        """Seconds until the first of `short_stages` that is too fast for an engine that is off."""
        found = np.flatnonzero(too_fast(vehicle, self.speed_mps[:short_stages]))
        return int(found[0]) if len(found) else None

    def seconds_w(self, short_stages: int) -> NDArray[np.float64]:
        """P0 of the seconds that come, up to `short_stages` or arrival."""
        return self.net_w[: int(np.count_nonzero(self.duration_s[:short_stages]))]


class Preview(NamedTuple):
    """The trip ahead as a navigation system delivers it in one second.

    Attributes
    ----------
    short_demand_w, short_speed_mps : of each of the coming N seconds, shape (N,)
    short_count : how many of them are driven before arrival
    long : statistics of the trip beyond, block by block, class by class; `rises`: how often the
        demand rises into that class or past it; `fall_j`, `rise_j`: of the block's end, read in
        its last class alone
    short_rise_j : room for the braking beyond, at the end of the N seconds; 0 where they reach
        the arrival
    """

    short_demand_w: NDArray[np.float64]
    short_speed_mps: NDArray[np.float64]
    short_count: int
    long: Stages
    short_rise_j: float


class StageBuilder:
    """Cuts a trip into stages at any time step.

    Slots are fixed from departure to arrival: the first N are the next N seconds, then each block
    beyond them has one slot per demand class. The bounds of blocks move on with the car
    (`HorizonSettings.edges`), no faster than it drives: a slot goes on from second to second with
    nearly the same statistics, and primal and dual variables are carried by slot. An empty block
    has duration 0.

    The forecast is read at the car's place on its route (`qpmpc.preview.place`) and may be wrong
    about the trip's length. A trip that outlasts it goes on with the short horizon alone, and the
    terminal band then applies to its end; a trip that ends before it is planned to its end as soon
    as the short horizon reaches the arrival, and the rest of the forecast is masked.

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
        padding = np.zeros(settings.short_stages)
        self._demand_w = np.concatenate([truth.demand_w, padding])
        self._speed_mps = np.concatenate([truth.speed_mps, padding])
        self._forecast_second = forecast_seconds(truth, forecast)
        demand_class = _demand_class(forecast.demand_w, settings)
        self._cumulative = _cumulative(forecast, vehicle, demand_class, settings.classes)
        self._cumulative_rises = _cumulative_rises(demand_class, settings.classes)
        self.count = settings.stage_count(forecast.steps)
        self._forecast_steps = forecast.steps
        self._place_s = settings.place_s(forecast.steps)
        start = np.arange(settings.block_count(forecast.steps)) * self._place_s
        start = np.minimum(start, forecast.steps)
        end = np.minimum(start + self._place_s, forecast.steps)
        self._swing_j = swings(forecast, vehicle, settings, start, end)
        self._room_j = rooms(forecast, vehicle, settings)
        self._use_j = uses(self._room_j, drops(forecast, vehicle, settings))

    def preview(self, step: int) -> Preview:
        """Return the trip ahead from time step `step`; short_count is 0 after arrival."""
        n = self.settings.short_stages
        now = min(max(step, 0), self.steps)
        edges = self._edges(now)
        rises = np.diff(self._cumulative_rises[:, edges], axis=1)
        return Preview(
            self._demand_w[now : now + n],
            self._speed_mps[now : now + n],
            min(n, self.steps - now),
            Stages(*np.vstack([self._long_fields(edges), rises.T.ravel(), self._kept_j(edges)])),
            0.0 if self._arrives(now) else float(self._room_j[self.beyond(now)]),
        )

    def at(self, step: int) -> Stages:
        """Return the stages of the horizon that starts at time step `step`."""
        return self.stages(self.preview(step))

    def held(self, stages: Stages, engine_on: bool, engine_for_s: int) -> Stages:
        """Return stages in whose seconds a run of the engine that has begun must go on.

        Masked stages are as before.

        Parameters
        ----------
        stages : from now on
        engine_on, engine_for_s : whether the engine runs, and for how long it has
        """
        left_s = begun_s(self._vehicle, engine_on, engine_for_s)
        if left_s == 0:
            return stages
        seconds = np.arange(self.count) < min(left_s, self.settings.short_stages)
        held = seconds & (stages.duration_s > 0.0)
        return replace(stages, must_share=np.where(held, 1.0, stages.must_share))

    def stages(self, preview: Preview) -> Stages:
        """Return the stages of a preview, short ones first."""
        n, seen = self.settings.short_stages, preview.short_count
        fields = np.zeros((FIELDS, self.count))
        trace = Trace(preview.short_demand_w[:seen], preview.short_speed_mps[:seen])
        fields[:, :seen] = _fields(trace, self._vehicle, _must(trace, self._vehicle))
        fields[OF_FREE, :seen] = fields[OF_ALL, :seen]  # of one second: its own
        long = preview.long
        fields[:, n:] = (
            long.duration_s,
            long.net_w,
            long.speed_mps,
            long.internal_off_w,
            long.must_share,
            long.free_net_w,
            long.free_internal_off_w,
        )
        rises = np.zeros(self.count)
        rises[:seen] = 1.0
        rises[n:] = starts_per_rise(long.rises, long.duration_s, self.settings)
        swing_j = np.zeros((2, self.count))
        swing_j[1, n - 1] = preview.short_rise_j
        classes = self.settings.classes
        ends_block = np.arange(len(long.fall_j)) % classes == classes - 1
        swing_j[:, n:] = np.where(ends_block, (long.fall_j, long.rise_j), -NO_LIMIT_J)
        return Stages(*np.vstack([fields, rises, swing_j]))

    def _edges(self, step: int) -> NDArray[np.intp]:
        """Bounds of the blocks beyond the short horizon of a time step, which are empty at arrival.

        Returns
        -------
        shape (blocks + 1,), see `HorizonSettings.edges`
        """
        first = self._forecast_steps if self._arrives(step) else self.beyond(step)
        return self.settings.edges(first, self._forecast_steps)

    def _arrives(self, step: int) -> bool:
        """Whether the short horizon reaches the arrival."""
        return step + self.settings.short_stages >= self.steps

    def beyond(self, step: int) -> int:
        """Return the first second of the forecast beyond the short horizon of a time step."""
        return int(self._forecast_second[min(step + self.settings.short_stages, self.steps)])

    def _kept_j(self, edges: NDArray[np.intp]) -> NDArray[np.float64]:
        """Kept from the SOC limits at the end of each block: that of the place where it ends.

        From the upper limit no more than has a use (`uses`) about the block's last second, U:

            max(min(rise, U), `LEAST_KEPT_J`)

        Returns
        -------
        fall and rise, shape (2, blocks * classes); 0 of an empty block
        """
        last = np.maximum(edges[1:] - 1, 0)
        kept_j = self._swing_j[:, last // max(self._place_s, 1)]
        kept_j[1] = np.maximum(np.minimum(kept_j[1], self._use_j[last]), LEAST_KEPT_J)
        return np.repeat(kept_j * (np.diff(edges) > 0), self.settings.classes, axis=1)

    def _long_fields(self, edges: NDArray[np.intp]) -> NDArray[np.float64]:
        """Fields of the long stages between those bounds; shape (FIELDS, blocks * classes)."""
        # (classes, FIELDS, blocks) -> fields of the long stages, block by block, class by class
        sums = np.diff(self._cumulative[:, :, edges], axis=2)
        fields = sums.transpose(1, 2, 0).reshape(FIELDS, -1)
        fields[1:] /= np.maximum(fields[0], 1.0)
        if self.settings.classes == 1:  # an averaged preview has only the mean demand
            fields[3] = internal_off_w(self._vehicle, fields[1])
            fields[4] = must_run(self._vehicle, fields[1], fields[2])
            fields[OF_FREE] = fields[OF_ALL]
        else:
            _mean_of_free(fields)
        return fields

    def shift(self) -> NDArray[np.intp]:
        """Slot in the previous step's solution from which each slot's warm start comes.

        Short stages move up by one and the last keeps its own values, which measured better than
        those of the long stage it leaves; long stages stay.
        """
        source = np.arange(self.count)
        source[: self.settings.short_stages - 1] += 1
        return source


def _must(trace: Trace, vehicle: Vehicle) -> NDArray[np.bool_]:
    """Whether the engine must run, second by second."""
    return must_run(vehicle, trace.battery_side_w(vehicle), trace.speed_mps)


def _fields(trace: Trace, vehicle: Vehicle, must: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Fields of each second, in the order of `Stages`; `OF_FREE` is 0 where there is no choice."""
    net_w = trace.battery_side_w(vehicle)
    off_w = trace.internal_off_w(vehicle)
    free = ~must
    return np.stack(
        [np.ones(trace.steps), net_w, trace.speed_mps, off_w, must, free * net_w, free * off_w]
    )


def _mean_of_free(fields: NDArray[np.float64]) -> None:
    """From means over all seconds to those over the seconds that leave a choice, where any do."""
    share = 1.0 - fields[4]
    some = share > LEAST_SHARE
    fields[OF_FREE] = np.where(some, fields[OF_FREE] / np.where(some, share, 1.0), fields[OF_ALL])


def _demand_class(demand_w: NDArray[np.float64], settings: HorizonSettings) -> NDArray[np.intp]:
    """Class of each step: 0 hard, 1 easy, 2 braking; all 0 with one class."""
    if settings.classes == 1:
        return np.zeros(len(demand_w), dtype=np.intp)
    easy_or_braking = np.where(demand_w < settings.class_braking_w, 2, 1)
    return np.where(demand_w > settings.class_hard_w, 0, easy_or_braking).astype(np.intp)


def _cumulative(
    forecast: Trace, vehicle: Vehicle, demand_class: NDArray[np.intp], classes: int
) -> NDArray[np.float64]:
    """Running sums over time of the fields, separately for each class.

    Returns
    -------
    shape (classes, FIELDS, steps + 1)
    """
    fields = _fields(forecast, vehicle, whole_runs(vehicle, _must(forecast, vehicle)))
    member = demand_class == np.arange(classes)[:, None]
    sums = np.zeros((classes, FIELDS, forecast.steps + 1))
    np.cumsum(fields[None] * member[:, None], axis=2, out=sums[:, :, 1:])
    return sums


def _cumulative_rises(demand_class: NDArray[np.intp], classes: int) -> NDArray[np.float64]:
    """Running count of the seconds that enter a class or pass it, from a lower demand.

    Returns
    -------
    shape (classes, steps + 1)
    """
    before = np.concatenate([[classes - 1], demand_class[:-1]])  # departure is from the lowest
    of = np.arange(classes)[:, None]
    rises = (before > of) & (demand_class <= of)
    sums = np.zeros((classes, len(demand_class) + 1))
    np.cumsum(rises, axis=1, out=sums[:, 1:])
    return sums


def starts_per_rise(
    rises: NDArray[np.float64], duration_s: NDArray[np.float64], settings: HorizonSettings
) -> NDArray[np.float64]:
    """Rises into each class of a block as `Stages.rises`, for stages from hard down to braking.

    A rise into a class starts the engine if it runs there and not below. The class below is the
    next stage, in which the on-share falls by what it rises from there: hence the sign. With kappa
    = `entry_share`,

        r = -rise_share max(rises - kappa, 0)   from one class that the block has to the next,
        r = kappa                               from the block before to the first that it has

    and from there to those beside them that it has not, which so hand its last on-share on. Where
    kappa is 0 nothing is handed on, and all classes but the first are as the first line has it.
    """
    classes, entry = settings.classes, settings.entry_share
    of_stage = np.zeros_like(rises).reshape(-1, classes)
    if classes == 1:  # an averaged preview has no order in time at all
        return of_stage.ravel()
    has = duration_s.reshape(-1, classes) > 0.0
    from_first = np.logical_or.accumulate(has, axis=1)[:, :-1]
    to_last = np.logical_or.accumulate(has[:, ::-1], axis=1)[:, -2::-1]
    falls = settings.rise_share * np.maximum(rises.reshape(-1, classes)[:, :-1] - entry, 0.0)
    of_stage[:, 0] = entry
    inside = (from_first & to_last) | (entry == 0.0)
    of_stage[:, 1:] = np.where(inside, -falls, entry)
    return of_stage.ravel()
