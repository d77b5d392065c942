"""A preview that is checked every second; what is not plausible is replaced by the last good one.

The same in C: codegen/runtime/mpc_check.c and mpc_qp.c. Described in docs/safety.md.
"""

from collections.abc import Callable
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from qpmpc.errors import QpmpcError
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Preview, StageBuilder, Stages
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.plant import Plant

LONGEST_STAGE_S = 1e5
SAME_MEANS_W = 1.0  # means of the same seconds differ by no more, in single precision too
NEWS = 0.2  # share of a preview that may change from one second to the next


class NoPreviewError(QpmpcError):
    """There is no plausible preview of this second, and none of the last N seconds to go on with.

    `RecedingHorizon` takes it as a planner without a plan.
    """


class CheckedPreview:
    """The stages of each second, from plausible previews only.

    A preview is plausible if the car can drive it and if it goes on from the one received before:
    a second that passes takes a second out of the trip ahead, so that the same message again is not
    news. A new route is therefore used from
    its second second on. In place of one that is not plausible the last good one serves for up to
    N - 1 seconds: its short stages move up and are masked at the end, its long ones are still
    ahead.

    Parameters
    ----------
    source : cuts the trip into stages
    plant : of the car; its state is never touched
    receive : returns the preview of a second; that of the source if None

    Attributes
    ----------
    was_bad : whether the last second's own preview was not plausible
    """

    def __init__(
        self,
        source: StageBuilder,
        plant: Plant,
        receive: Callable[[int], Preview] | None = None,
    ) -> None:
        self.source, self.was_bad = source, False
        self.receive = receive or source.preview
        self._can = Capability.of(plant.vehicle, plant.line)
        self._last: Stages | None = None
        self._last_step = 0
        self._received: Preview | None = None
        self._received_step = 0

    @property
    def settings(self) -> HorizonSettings:
        """Layout of the stages."""
        return self.source.settings

    @property
    def count(self) -> int:
        """Number of stages."""
        return self.source.count

    def shift(self) -> NDArray[np.intp]:
        """See `StageBuilder.shift`."""
        return self.source.shift()

    def forget(self) -> None:
        """Forget all earlier previews."""
        self._last = self._received = None

    def at(self, step: int) -> Stages:
        """Return the stages of the horizon that starts at time step `step`.

        Raises
        ------
        NoPreviewError
            If there is none to go by.
        """
        received = self.receive(step)
        possible = self._is_possible(received)
        self.was_bad = not (possible and self._goes_on(received, step))
        if possible:
            self._received, self._received_step = received, step
        if not self.was_bad:
            self._last, self._last_step = self.source.stages(received), step
            return self._last
        passed = step - self._last_step
        if self._last is None or not 0 <= passed < self.settings.short_stages:
            raise NoPreviewError(f"no plausible preview at {step} s")
        return _moved_up(self._last, passed, self.settings.short_stages)

    def ahead(self, step: int, engine_on: bool, engine_for_s: int) -> Stages:
        """Return the same; a run of the engine that has begun goes on for `engine.min_on_s`.

        Parameters
        ----------
        step : as of `at`
        engine_on, engine_for_s : whether the engine runs, and for how long it has

        Raises
        ------
        NoPreviewError
            As `at`.
        """
        return self.source.held(self.at(step), engine_on, engine_for_s)

    def _is_possible(self, preview: Preview) -> bool:
        """Whether the car can drive it."""
        can, n, long = self._can, self.settings.short_stages, preview.long
        return (
            1 <= preview.short_count <= n
            and _within(preview.short_demand_w, can.demand_min_w, can.demand_max_w)
            and _within(preview.short_speed_mps, 0.0, can.speed_max_mps)
            and _within(long.duration_s, 0.0, LONGEST_STAGE_S)
            and _within(long.net_w, can.net_min_w, can.net_max_w)
            and _within(long.speed_mps, 0.0, can.speed_max_mps)
            and _within(long.internal_off_w, can.internal_min_w, can.internal_max_w)
            and _within(long.must_share, 0.0, 1.0)
            and _within(long.free_net_w, can.net_min_w, can.net_max_w)
            and _within(long.free_internal_off_w, can.internal_min_w, can.internal_max_w)
            and _within(long.rises, 0.0, LONGEST_STAGE_S)
            and _within(long.fall_j, 0.0, can.energy_j)
            and _within(long.rise_j, 0.0, can.energy_j)
            and 0.0 <= preview.short_rise_j <= can.energy_j
            and _tells_free_means(long)
        )

    def _goes_on(self, preview: Preview, step: int) -> bool:
        """Whether it is that of the second before, but for the time passed and some news.

        Each second that passes takes at most a second, and what is driven in it, out of the
        statistics of the trip and over the bounds of blocks that move on, out of one and into the
        other; NEWS is the share of the trip that may change beside that.
        """
        before, can = self._received, self._can
        if before is None:
            return True
        passed = step - self._received_step
        old, new = before.long, preview.long
        if passed > 0 and _is_same(before, preview):
            return False  # an old message once more
        free_s = 2.0 * max(self.settings.blocks, 1) * passed + NEWS * float(old.duration_s.sum())
        kept = self.settings.short_stages - passed
        news_w = np.abs(preview.short_demand_w[: max(kept, 0)] - before.short_demand_w[passed:])
        return (
            float(np.abs(new.duration_s - old.duration_s).sum()) <= free_s
            and _moved(old, new, "net_w") <= free_s * (can.net_max_w - can.net_min_w)
            and _moved(old, new, "internal_off_w")
            <= free_s * (can.internal_max_w - can.internal_min_w)
            and float(news_w.sum()) <= NEWS * self.settings.short_stages * can.net_max_w
        )


def _tells_free_means(long: Stages) -> bool:
    """Whether the means over the seconds with a choice are those over all, where all have one.

    A caller in C who does not know them leaves them at 0.
    """
    apart_w = np.abs(long.free_net_w - long.net_w)
    apart_w += np.abs(long.free_internal_off_w - long.internal_off_w)
    apart_j = (long.duration_s * apart_w)[long.must_share <= 0.0].sum()
    return bool(apart_j <= SAME_MEANS_W * long.duration_s.sum())


def _is_same(one: Preview, other: Preview) -> bool:
    return (
        one.short_count == other.short_count
        and np.array_equal(one.short_demand_w, other.short_demand_w)
        and np.array_equal(one.long.duration_s, other.long.duration_s)
    )


def _moved(old: Stages, new: Stages, field: str) -> float:
    """Change of a quantity, summed over the time of each long stage."""
    totals = [stages.duration_s * getattr(stages, field) for stages in (old, new)]
    return float(np.abs(totals[1] - totals[0]).sum())


def _within(values: NDArray[np.float64], low: float, high: float) -> bool:
    """False for NaN."""
    return bool(((values >= low) & (values <= high)).all())


def _moved_up(stages: Stages, by: int, n_short: int) -> Stages:
    """Short stages move up by some seconds and are masked at the end; long ones stay."""
    now = np.stack([getattr(stages, field.name) for field in fields(stages)])
    moved = now.copy()
    moved[:, : n_short - by] = now[:, by:n_short]
    moved[:, n_short - by : n_short] = 0.0
    return Stages(*moved)
