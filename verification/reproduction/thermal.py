"""The coolant as a store: heat put in and taken out, and when."""

from dataclasses import dataclass

import numpy as np

from qpmpc.results import Run

LAST_SHARE = 1.0 / 3.0


@dataclass(frozen=True)
class ThermalStory:
    """Heat and charge of one trip.

    Attributes
    ----------
    stored_mj : C (T_peak - T_start)
    released_mj : C (T_peak - T_end), heat used while driving with the engine off
    peak_s : time of the highest coolant temperature
    soc_peak_s : time of the highest SOC
    off_share : share of the whole trip with the engine off
    off_share_last : share of the last third with the engine off
    final_off_s : time from the last engine-on second to arrival
    """

    stored_mj: float
    released_mj: float
    peak_s: int
    soc_peak_s: int
    off_share: float
    off_share_last: float
    final_off_s: int


def thermal_story(run: Run) -> ThermalStory:
    """Measure one trip."""
    trajectory = run.trajectory
    capacity_mj_per_k = run.vehicle.thermal.heat_capacity_j_per_k / 1e6
    coolant, on = trajectory.t_cl_degc, trajectory.engine_on
    last = on[-max(round(len(on) * LAST_SHARE), 1) :]
    running = np.flatnonzero(on)
    return ThermalStory(
        stored_mj=capacity_mj_per_k * float(coolant.max() - coolant[0]),
        released_mj=capacity_mj_per_k * float(coolant.max() - coolant[-1]),
        peak_s=int(coolant.argmax()),
        soc_peak_s=int(trajectory.soc.argmax()),
        off_share=float(1.0 - on.mean()),
        off_share_last=float(1.0 - last.mean()),
        final_off_s=len(on) - 1 - int(running[-1]) if len(running) else len(on),
    )
