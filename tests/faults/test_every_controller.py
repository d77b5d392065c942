"""Faults reach every controller that has what they are faults of; the others say so."""

import numpy as np
import pytest

from qpmpc import Command, CvxpyPlanner, Cycle, Trip, load_cycle, simulate
from qpmpc.closed_loop import drive
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.replay import Replay
from qpmpc.faults.models import as_faults
from qpmpc.registry import make_controller, split_settings

AT_S = 25
FAULTS = [
    {"kind": "wild", "at_s": AT_S},
    {"kind": "solver-failure", "at_s": AT_S + 10},
    {"kind": "nan", "signal": "soc", "at_s": AT_S + 15},
]


@pytest.fixture(scope="module")
def cycle() -> Cycle:
    """A minute of NYCC in which the car drives."""
    nycc = load_cycle("nycc")
    return Cycle.from_samples("minute", np.arange(61.0), nycc.speed_mps[140:201])


@pytest.fixture(scope="module")
def trip(cycle: Cycle) -> Trip:
    return Trip(cycle)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "settings"),
    [
        ("mh-qp", {"mh_qp.implementation": "python"}),
        ("mh-qp", {}),
        ("mh-qp-paper", {}),
        ("baseline-mpc", {}),
        ("mh-nlp", {}),
        ("mh-costate", {}),
        (CvxpyPlanner, {}),
    ],
    ids=["python", "c", "paper", "baseline", "nlp", "costate", "cvxpy"],
)
def test_preview_solver_and_measurement(cycle, trip, controller, settings):
    if controller == "mh-nlp":
        pytest.importorskip("casadi")
        # IPOPT is three times as fast where starts are free, and slow: no more than the faults
        seconds = AT_S + 21
        short = Cycle.from_samples("short", np.arange(float(seconds)), cycle.speed_mps[:seconds])
        trip = Trip(short, "paper-nimh")
    made = make_controller(controller, trip, split_settings(settings)[1])
    drive(trip, made)
    made.reset()  # nothing of the run before is left, its preview for example
    run = drive(trip, made, faults=as_faults(FAULTS))
    flags = {t: Flag(each) for t, each in enumerate(run.trajectory.flags.tolist()) if each}
    assert flags == {
        AT_S: Flag.BAD_PREVIEW,
        AT_S + 10: Flag.SOLVER_FAILED,
        AT_S + 15: Flag.BAD_MEASUREMENT,
    }
    rungs = {t: rung for t, rung in enumerate(run.trajectory.fallback) if rung}
    assert rungs == {AT_S + 10: "shifted plan"}
    assert not any("no effect" in remark for remark in run.remarks)


class Recorded(Replay):
    name = "recorded"

    def commands(self, progress):
        return [Command(k % 2 == 0, 9e3 if k % 2 == 0 else 0.0) for k in range(self.trip.steps)]


def test_a_replay_is_reached_by_what_happens_to_its_commands_only(trip):
    clock = {"kind": "jump", "signal": "second", "value": 1e6, "at_s": AT_S, "for_s": 2}
    late = {"kind": "late", "value": 1, "at_s": 40, "for_s": 4}
    run = simulate(trip, Recorded, faults=[clock, *FAULTS[:2], late])
    plain = simulate(trip, Recorded)
    differs = np.flatnonzero(run.trajectory.engine_on != plain.trajectory.engine_on)
    assert differs.tolist() == [40, 41, 42, 43]
    said = [remark for remark in run.remarks if "no effect" in remark]
    assert len(said) == 3
    assert "jump of second (1e+06): it replays commands" in said[0]
