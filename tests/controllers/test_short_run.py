"""A run of which the plan wants less than the shortest one begins where it costs least."""

import numpy as np
import pytest
from bare_seconds import bare_stages, going, second
from hypothesis import assume, given
from hypothesis import strategies as st
from short_trip import assert_same_commands, drive_in

from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.last_run import SAME_G
from qpmpc.controllers.short_run import short_run_w
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle import load_vehicle

CAR = load_vehicle()
POLISH = Polish(CAR, PwaModel.of(CAR))
PRICES = Prices(fuel=1.08, p_eng=0.0, internal=6.5e-5)  # under way, heat of fuel set off
STANDING_W, DRIVING_W, LAUNCH_W = 400.0, 12e3, 30e3
SECONDS = 20
REST = [STANDING_W] * (SECONDS - 4)


def early_w(net_w, on_share, must=(), car=CAR, prices=PRICES, seconds=SECONDS) -> float:
    """Return the power at which a run begins now; what is not given of the seconds is 0."""
    count = len(net_w)
    trip = bare_stages(POLISH, net_w, must, seconds)
    share = np.append(on_share, np.zeros(count - len(on_share)))
    of_plan = going(POLISH, prices, trip, count)
    return short_run_w(car.engine, of_plan, prices.fuel, trip, share)


def dearer_g(net_w: float) -> float:
    return second(POLISH, PRICES, net_w).dearer_g_per_s


LAUNCH = [DRIVING_W, DRIVING_W, LAUNCH_W, LAUNCH_W, *REST]
SHARES = [0.0, 0.0, 1.0, 1.0]


def test_it_begins_before_a_launch_rather_than_idle_behind_it() -> None:
    """Two seconds that the battery cannot give, of a shortest run of four."""
    assert CAR.engine.min_on_s == 4
    now_w = POLISH.power_w(PRICES, DRIVING_W, 0.0)
    assert dearer_g(DRIVING_W) < dearer_g(STANDING_W)
    assert early_w(LAUNCH, SHARES, must=(2, 3)) == now_w


def test_it_waits_for_the_best_start() -> None:
    """One second of driving before the launch: the run takes that, and one at idle behind."""
    later = [STANDING_W, DRIVING_W, LAUNCH_W, LAUNCH_W, *REST]
    assert early_w(later, SHARES, must=(2, 3)) == 0.0
    assert early_w(later[1:], SHARES[1:], must=(1, 2)) > 0.0


def test_not_where_it_spares_nothing() -> None:
    """Driving behind the launch, or a plan that runs the engine there anyway."""
    driving = [*LAUNCH[:4], DRIVING_W, DRIVING_W, *REST]
    standing = [STANDING_W, STANDING_W, *LAUNCH[2:]]
    assert early_w(driving, SHARES, must=(2, 3)) == 0.0
    assert early_w(standing, SHARES, must=(2, 3)) == 0.0
    assert early_w(LAUNCH, [*SHARES, 1.0, 1.0], must=(2, 3)) == 0.0


@pytest.mark.parametrize(("share", "begins"), [(1.0, True), (0.9, False)])
def test_not_before_a_start_that_the_plan_would_round_away(share, begins) -> None:
    """Two whole seconds of four are a start, a little less is none; a forced one always is."""
    assert (early_w(LAUNCH, [0.0, 0.0, 1.0, share]) > 0.0) is begins
    assert early_w(LAUNCH, [0.0, 0.0, 1.0, share], must=(2,)) > 0.0


def test_not_where_something_else_decides() -> None:
    """A run now or far off, an arrival within it, free starts, a plan that wants heat."""
    free = CAR.with_settings({"engine.start_fuel_g": 0.0, "engine.start_energy_j": 0.0})
    heating = PRICES._replace(fuel=0.4, internal=0.4 * PRICES.internal)
    far = [DRIVING_W] * 4 + LAUNCH[2:]
    assert early_w(LAUNCH, [0.6, 0.0, 1.0, 1.0], must=(2, 3)) == 0.0
    assert early_w(far, [0.0, 0.0, *SHARES], must=(4, 5)) == 0.0
    assert early_w(LAUNCH, SHARES, must=(2, 3), seconds=6) > 0.0
    assert early_w(LAUNCH, SHARES, must=(2, 3), seconds=5) == 0.0
    assert early_w(LAUNCH, SHARES, must=(2, 3), car=free) == 0.0
    assert early_w(LAUNCH, SHARES, must=(2, 3), prices=heating) == 0.0
    single = CAR.with_settings({"engine.min_on_s": 1})
    assert early_w(LAUNCH, SHARES, must=(2, 3), car=single) == 0.0


@given(
    net_w=st.lists(st.floats(-2e4, 3e4), min_size=SECONDS, max_size=SECONDS),
    on_share=st.lists(st.sampled_from([0.0, 0.4, 0.6, 1.0]), min_size=12, max_size=12),
    first=st.integers(1, 5),
    run_s=st.integers(1, 6),
)
def test_it_is_the_cheapest_of_all_starts(net_w, on_share, first, run_s) -> None:
    """Against every start up to the plan's first second, by the cost of all seconds that run."""
    on_share = [0.0] * first + [1.0] + on_share
    car = CAR.with_settings({"engine.min_on_s": run_s})
    plan = np.array(on_share) >= 0.5
    cost_g = np.maximum([dearer_g(w) for w in net_w], 0.0)[: len(plan)]

    def run_g(start: int) -> float:
        seconds = np.arange(len(plan))
        ends = max(first, start) + run_s
        runs = (seconds >= start) & (seconds < start + run_s) | plan & (seconds < ends)
        return float(cost_g[runs].sum())

    of_start = [run_g(start) for start in range(first + 1)]
    asked_w = early_w(net_w, on_share, must=(first,), car=car)
    now_w = POLISH.power_w(PRICES, net_w[0], 0.0)
    spares_g = min(of_start[1:]) - of_start[0]
    assume(abs(spares_g - SAME_G) > 1e-9)
    assert asked_w == (now_w if first < run_s and spares_g > SAME_G else 0.0)


ROAD = "random-7268-201s"
OF_ROAD = {
    "thermal.t_amb_degc": -0.549117,
    "trip.soc_init": 0.475542,
    "trip.t_cl_init_degc": 66.081518,
}


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, ROAD, "prius-liion", OF_ROAD)


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_begins_as_python_does(monkeypatch) -> None:
    """Three minutes; without it two runs go on for a second of slow driving."""
    now, in_c = drive("python"), drive("c")
    monkeypatch.setattr("qpmpc.controllers.coming_second.short_run_w", lambda *_: 0.0)
    before = drive("python")
    assert_same_commands(now, in_c)
    taken, left = now.engine_on & ~before.engine_on, before.engine_on & ~now.engine_on
    assert taken.sum() == left.sum() > 0
    assert now.demand_w[taken].min() > now.demand_w[left].max()
    soc_g = 171.0  # of a unit of SOC on this trip, dynamic programming's
    fuel_g = [run.fuel_g.sum() - soc_g * run.soc[-1] for run in (now, before)]
    assert fuel_g[1] - fuel_g[0] > 0.1
