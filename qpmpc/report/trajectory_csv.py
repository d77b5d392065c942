"""Trajectories as CSV: one row per second, the unit in the name of each column."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.monitor import Flag
from qpmpc.report.csv_text import csv_text
from qpmpc.results import Run
from qpmpc.trajectory import Trajectory

STATES = ("soc", "t_cl_degc")
FLOWS = (
    "speed_mps",
    "demand_w",
    "engine_on",
    "p_eng_w",
    "p_bat_w",
    "p_friction_w",
    "fuel_g",
    "coolant_w",
    "power_excess_w",
    "step_time_s",
    "iterations",
    "relaxation_gap",
    "certificate_g",
    "on_share",
)
COLUMNS = ("time_s", *STATES, *FLOWS, "fallback", "flags")


def trajectory_csv(run: Run) -> str:
    """Return the trajectory of a run as CSV.

    A row holds the state at `time_s` and the flows of the second that starts there; the last row
    is the final state alone. Cells are empty where a controller has no such figure. Several flags
    are joined by " + ".
    """
    trajectory = run.trajectory
    steps = len(trajectory.fuel_g)
    states = [_cells(getattr(trajectory, name)) for name in STATES]
    flows = [[*_cells(_flow(trajectory, name)), ""] for name in FLOWS]
    words = [" + ".join(Flag(each).names()) for each in trajectory.flags.tolist()]
    said = [*trajectory.fallback, ""], [*words, ""]
    return csv_text(COLUMNS, zip(range(steps + 1), *states, *flows, *said, strict=True))


def _flow(trajectory: Trajectory, name: str) -> NDArray[np.float64]:
    values: NDArray[np.float64] = getattr(trajectory, name)
    return values.astype(int) if values.dtype == np.bool_ else values


def _cells(values: NDArray[np.float64]) -> list[object]:
    """Shortest texts that read back as the same numbers; empty for nan."""
    return ["" if value != value else value for value in values.tolist()]
