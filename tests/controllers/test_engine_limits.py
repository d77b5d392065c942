"""Ramp, cranking, shortest run and rest in whole trips, whatever the controller plans."""

import numpy as np
import pytest
from plain import plain_car

from qpmpc.engine_runs import ended_runs_s
from qpmpc.registry import CONTROLLERS
from qpmpc.results import OPTIMUM
from qpmpc.simulation import simulate
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle.plant import LONG_AGO_S
from qpmpc.verification.safety.every_command import EveryCommand, Seconds

MIN_ON_S, MIN_OFF_S, RAMP_W_PER_S = 4, 2, 9.5e3
CAR = plain_car().with_settings(
    {
        "engine.start_fuel_g": 0.2,
        "engine.start_energy_j": 3.5e3,
        "engine.min_on_s": MIN_ON_S,
        "engine.min_off_s": MIN_OFF_S,
        "engine.ramp_w_per_s": RAMP_W_PER_S,
    }
)
CAUSAL = [name for name in CONTROLLERS.shipped if name != OPTIMUM]


def seconds_of(tr: Trajectory) -> Seconds:
    """The seconds of a run as its controller met them."""
    before = np.concatenate([[False], tr.engine_on[:-1]])
    for_s, count = [], LONG_AGO_S
    for k in range(len(before)):
        for_s.append(count)
        count = count + 1 if tr.engine_on[k] == before[k] else 1
    return Seconds(
        tr.soc[:-1],
        tr.t_cl_degc[:-1],
        before.astype(float),
        tr.demand_w,
        tr.speed_mps,
        np.array(for_s, dtype=float),
        np.concatenate([[0.0], tr.p_eng_w[:-1]]),
    )


def ended_too_early(tr: Trajectory) -> tuple[int, int]:
    """Seconds in which a run or rest is cut short: all, and those without a limit that asks so."""
    at = seconds_of(tr)
    was_on = at.engine_on > 0.0
    early = (tr.engine_on != was_on) & (at.engine_for_s < np.where(was_on, MIN_ON_S, MIN_OFF_S))
    return int(early.sum()), int((early & EveryCommand(CAR).could_go_on(at)).sum())


@pytest.mark.parametrize("controller", CAUSAL)
def test_every_controller_keeps_ramp_and_shortest_runs(controller) -> None:
    run = simulate("nycc", controller, CAR)
    tr, row = run.trajectory, run.summary()
    assert row["engine_starts"] > 5
    rise_w = np.diff(tr.p_eng_w, prepend=0.0)
    assert rise_w.max() <= RAMP_W_PER_S
    assert row["violations"]["power_w"] == 0.0
    cut_short, without_need = ended_too_early(tr)
    assert without_need == 0
    if cut_short == 0:
        assert ended_runs_s(tr.engine_on).min() >= MIN_ON_S
        assert row["engine_runs_below_min_on_s"] == 0
