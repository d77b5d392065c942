"""A short trip driven in Python or in C, for tests of what a controller does in single seconds."""

import numpy as np

import qpmpc
from qpmpc.trajectory import Trajectory

Start = dict[str, float]


def drive_in(
    made_in: str, trip: str, vehicle: str, start: Start, controller: str = "mh-qp"
) -> Trajectory:
    """Drive from a start, as settings, by an implementation of a controller."""
    settings = {**start, f"{controller.replace('-', '_')}.implementation": made_in}
    return qpmpc.simulate(trip, controller, vehicle=vehicle, settings=settings).trajectory


def assert_same_commands(run: Trajectory, other: Trajectory) -> None:
    """Commands of Python and of C in double precision: rounding, which a choice never shows."""
    np.testing.assert_array_equal(run.engine_on, other.engine_on)
    np.testing.assert_allclose(run.p_eng_w, other.p_eng_w, rtol=1e-6, atol=1e-3)
