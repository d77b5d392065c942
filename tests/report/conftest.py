"""Runs to report on: a short trip, driven by the rules and by the multi-horizon QP."""

import numpy as np
import pytest

from qpmpc.cycles import Cycle
from qpmpc.results import Run, compare_runs
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    # the name is what a hostile file might be called
    speed = [0.0, 3.0, 6.0, 9.0, 12.0, 14.0, 14.0, 14.0, 14.0, 12.0, 8.0, 4.0, 0.0]
    trip = Cycle.from_samples("<b>[red]long_name_of_a_trip", 3.0 * np.arange(len(speed)), speed)
    return [simulate(trip, name, load_vehicle()) for name in ("rule-based", "mh-qp")]


@pytest.fixture
def rows(runs: list[Run]) -> list[dict]:
    return compare_runs(runs)
