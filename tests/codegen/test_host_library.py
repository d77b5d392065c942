"""The C controller on this machine against the Python controller, step by step."""

import ctypes
import json
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import CodegenError, compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.host_library import compiled
from qpmpc.codegen.values import CONSTANTS
from qpmpc.controllers.base import Decision
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.qp_planner import FAILURES_FORGIVEN, WARM_UP_STEPS
from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.preview import StageBuilder
from qpmpc.preview.stages import Preview
from qpmpc.registry import make_controller
from qpmpc.simulation import simulate
from qpmpc.solvers import base
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import optimal_line

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")

VEHICLE = load_vehicle()


def settings_of(**overrides: object) -> ControllerSettings:
    chosen = {key.replace("__", "."): value for key, value in overrides.items()}
    return ControllerSettings().with_settings(chosen)


def pair(
    cycle_name: str, precision: str = "f64", vehicle=VEHICLE, **overrides: object
) -> tuple[Trip, GeneratedController, MhQp]:
    trip, settings = Trip(cycle_name, vehicle), settings_of(**overrides)
    return trip, GeneratedController(trip, settings, precision=precision), MhQp(trip, settings)


def compare(trip, ours, reference, steps: int):
    """Drive with the reference's commands; yields both decisions and plans of every step."""
    state = trip.plant.initial_state()
    for k in range(steps):
        seen = trip.observation(k, state)
        mine, its = ours.decide(seen), reference.decide(seen)
        yield mine, its
        state, _ = trip.plant.step(state, its.command, seen.demand_w, seen.speed_mps)


def assert_equal_decision(mine: Decision, its: Decision, power_w: float) -> None:
    assert mine.command.engine_on == its.command.engine_on
    assert mine.command.p_eng_w == pytest.approx(its.command.p_eng_w, abs=power_w)
    assert (mine.fallback, mine.flags) == (its.fallback, its.flags)
    assert mine.on_share == pytest.approx(its.on_share, abs=1e-6, nan_ok=True)
    assert mine.relaxation_gap == pytest.approx(its.relaxation_gap, abs=1e-6, nan_ok=True)


# The same algorithm in another order of summation: round-off of 1e-16, grown by the condition of
# the KKT matrix (1e6) and carried along by the warm start, stays far below 1e-6 of the quantities.
@pytest.mark.parametrize("name", ["nycc", "nedc-truncated"])
def test_double_precision_equals_python_to_the_end_of_the_trip(name) -> None:
    trip, ours, reference = pair(name)
    for mine, its in compare(trip, ours, reference, trip.steps):
        assert_equal_decision(mine, its, power_w=1e-3)


def test_primal_and_dual_variables_equal_python() -> None:
    trip, ours, reference = pair("nycc")
    for _ in compare(trip, ours, reference, 100):
        x, duals = ours.plan()
        plan = reference.planner.last
        assert plan is not None
        scale = np.abs(plan.x).max(axis=0)
        np.testing.assert_allclose(x[:, :6] / scale[:6], plan.x[:, :6] / scale[:6], atol=1e-8)
        np.testing.assert_allclose(x[:, 6], plan.x[:, 6], atol=1e-6)  # slack, K: nearly 0
        np.testing.assert_allclose(duals, plan.duals, atol=1e-8 * np.abs(plan.duals).max())


@pytest.mark.parametrize(
    ("vehicle", "overrides"),
    [
        ("prius-liion", {}),
        ("prius-nimh", {"mh_qp__scaling__duration_exponent": 1.0, "mh_qp__admm__iterations": 17}),
        ("prius-nimh", {"mh_qp__scaling__duration_exponent": 0.3}),
        ("prius-nimh", {"mh_qp__qp__soc_penalty_g": 400.0}),
        ("prius-nimh", {"mh_qp__horizon__classes": 1, "mh_qp__horizon__short_stages": 12}),
        ("prius-nimh", {"mh_qp__horizon__blocks": 0, "mh_qp__horizon__block_s": 100}),
        ("prius-nimh", {"mh_qp__prepared": False}),
        ("prius-liion", {"mh_qp__learning": True}),
    ],
)
def test_other_vehicles_and_settings_equal_python(vehicle, overrides) -> None:
    trip, ours, reference = pair("nycc", vehicle=load_vehicle(vehicle), **overrides)
    for mine, its in compare(trip, ours, reference, 120):
        assert_equal_decision(mine, its, power_w=1e-2)


def test_what_is_learned_equals_python() -> None:
    """A wrong map, and a meter that fails from second to second and at departure."""
    trip = Trip("nycc").with_settings({"model.fuel_tilt": -0.1})
    settings = settings_of(mh_qp__learning=True)
    mine = GeneratedController(trip.as_believed, settings)
    its = MhQp(trip.as_believed, settings)
    state = trip.plant.initial_state()
    for second in range(200):
        seen = trip.observation(second, state)
        if second % 7 == 0:
            seen = seen._replace(fuel_g=(math.nan, -1.0, 1e3, 0.4)[second % 4])
        ours, reference = mine.decide(seen), its.decide(seen)
        assert_equal_decision(ours, reference, power_w=1e-2)
        assert (Flag.BAD_MEASUREMENT in ours.flags) == (second % 28 in (0, 14, 21))
        state, _ = trip.plant.step(state, reference.command, seen.demand_w, seen.speed_mps)
    assert its.planner.learned_fuel is not None
    idle, slope = its.planner.learned_fuel.idle_and_slope
    assert idle + 0.2 * slope < -0.005  # at a fifth of full power the map is 6 % too high


@pytest.mark.parametrize(
    ("key", "value"),
    [("trip.t_cl_init_degc", 88.5), ("trip.t_cl_init_degc", 40.1), ("trip.soc_init", 0.41)],
)
def test_safety_layer_equals_python_at_the_limits(key, value) -> None:
    vehicle = VEHICLE.with_settings({key: value})
    trip, ours, reference = pair("nedc-truncated", vehicle=vehicle)
    for mine, its in compare(trip, ours, reference, 300):
        assert_equal_decision(mine, its, power_w=1e-2)


# Single precision leaves 1e-5 of a solver unit in a problem that is nearly linear: near its optimum
# power moves by some 100 W at almost no cost. What counts is fuel: 0.1 % is required.
@pytest.mark.parametrize("name", ["nycc", "nedc-truncated"])
def test_single_precision_burns_the_same_fuel(name) -> None:
    trip = Trip(name, VEHICLE)
    single = drive(trip, GeneratedController(trip, precision="f32"))
    python = simulate(trip, "mh-qp", settings=settings_of(mh_qp__implementation="python"))
    assert single.fuel_soc_balanced_g == pytest.approx(python.fuel_soc_balanced_g, rel=1e-3)
    assert single.summary()["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
    assert single.summary()["fallback_steps"] == 0


def test_two_instances_interleaved_do_not_disturb_each_other() -> None:
    trip, alone, _ = pair("nycc")
    first, second = pair("nycc")[1], pair("nycc")[1]
    state = trip.plant.initial_state()
    for k in range(60):
        seen = trip.observation(k, state)
        expected = alone.decide(seen)
        assert first.decide(seen) == expected
        other = seen._replace(soc=0.5, t_cl_degc=70.0)  # leads the second one elsewhere
        second.decide(other)
        state, _ = trip.plant.step(state, expected.command, seen.demand_w, seen.speed_mps)


class Raw:
    """A controller whose inputs a test can spoil."""

    def __init__(self, precision: str = "f64") -> None:
        self.trip, self.controller, _ = pair("nycc", precision)
        self.controller.begin(self.trip)
        self.library = self.controller.library
        self.state = self.trip.plant.initial_state()

    def step(self, k: int, **spoilt: object):
        """Run step k with some inputs replaced: a value, of all of an array, or (index, value)."""
        self.controller.inputs.fill(self.trip.observation(k, self.state), self.controller._in)
        for name, value in spoilt.items():
            if isinstance(value, tuple):
                getattr(self.controller._in, name)[value[0]] = value[1]
            elif isinstance(of := getattr(self.controller._in, name), ctypes.Array):
                of[:] = [value] * len(of)
            else:
                setattr(self.controller._in, name, value)
        flags = self.library.step(*self.controller._arguments)
        out = self.controller._out
        assert flags == out.flags
        assert math.isfinite(out.p_eng_w)
        assert 0.0 <= out.p_eng_w <= VEHICLE.engine.power_max_w
        # the library writes every second into the same memory
        return type(out).from_buffer_copy(out)


# The last good demand stands in for one second, and the safety layer is not needed here. SOC and
# coolant are predicted as the plant moves, here under another command by rounding at most.
STOOD_IN_W = 1.0
BAD_MEASUREMENT, BAD_PREVIEW = Flag.BAD_MEASUREMENT, Flag.BAD_PREVIEW
OF_THE_FREE = ("must_share", "free_net_w", "free_internal_off_w")
BAD = [
    ({"soc": math.nan}, BAD_MEASUREMENT),
    ({"soc": 1.5}, BAD_MEASUREMENT),
    ({"t_cl_degc": math.inf}, BAD_MEASUREMENT),
    ({"demand_w": -math.inf}, BAD_MEASUREMENT),
    ({"speed_mps": -1.0}, BAD_MEASUREMENT),
    ({"short_demand_w": (2, math.nan)}, BAD_PREVIEW),
    ({"short_speed_mps": (4, 1e9)}, BAD_PREVIEW),
    ({"long_duration_s": (0, -1.0)}, BAD_PREVIEW),
    ({"long_net_w": (20, math.nan)}, BAD_PREVIEW),
    ({"long_speed_mps": (3, math.inf)}, BAD_PREVIEW),
    ({"long_internal_off_w": (3, math.nan)}, BAD_PREVIEW),
    ({"long_must_share": (3, 1.5)}, BAD_PREVIEW),
    ({"long_free_net_w": (3, math.nan)}, BAD_PREVIEW),
    ({"long_free_internal_off_w": (3, 1e9)}, BAD_PREVIEW),
    # a caller who does not know the seconds without a choice, and leaves their arrays at 0
    ({f"long_{name}": 0.0 for name in OF_THE_FREE}, BAD_PREVIEW),
    ({"long_free_internal_off_w": 0.0}, BAD_PREVIEW),
    ({"long_rises": (3, -1.0)}, BAD_PREVIEW),
    ({"long_rises": (3, math.nan)}, BAD_PREVIEW),
    ({"long_fall_j": (5, -1.0)}, BAD_PREVIEW),
    ({"long_fall_j": (5, math.inf)}, BAD_PREVIEW),
    ({"long_rise_j": (5, math.nan)}, BAD_PREVIEW),
    ({"long_rise_j": (5, 1e9)}, BAD_PREVIEW),
    ({"short_rise_j": -1.0}, BAD_PREVIEW),
    ({"short_rise_j": math.nan}, BAD_PREVIEW),
    ({"short_rise_j": 1e9}, BAD_PREVIEW),
    ({"short_count": 0}, BAD_PREVIEW),
    ({"short_count": 21}, BAD_PREVIEW),
    ({"soc": math.nan, "short_count": -(2**31)}, BAD_MEASUREMENT | BAD_PREVIEW),
]


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize(("spoilt", "flag"), BAD)
def test_bad_input_is_named_and_costs_no_plan(precision, spoilt, flag) -> None:
    raw, clean = Raw(precision), Raw(precision)
    for one in (raw, clean):
        one.step(0)
    bad, right = raw.step(1, **spoilt), clean.step(1)
    # what the model expects, or the last good preview, stands in: here both are what is true
    assert (bad.flags, bad.rung) == (flag, 0)
    assert (bad.engine_on, bad.p_eng_w) == (
        right.engine_on,
        pytest.approx(right.p_eng_w, abs=STOOD_IN_W),
    )
    good = raw.step(2)
    assert (good.flags, good.rung) == (0, 0)  # the bad value has poisoned nothing


def test_without_a_preview_for_long_the_rules_take_over() -> None:
    raw = Raw()
    raw.step(0)
    rungs = [raw.step(k, short_count=0).rung for k in range(1, 33)]
    # the last good preview reaches for N - 1 = 19 s, and the plan made from it for some more
    old = PLAN_VALID_STEPS
    assert rungs == [0] * 19 + [1] * old + [2] * (13 - old)
    assert raw.step(33).rung == 0


def test_measurements_that_the_car_cannot_reach_are_not_believed_at_once() -> None:
    raw = Raw()
    raw.step(0)
    flags = [raw.step(k, soc=0.55).flags for k in range(1, 15)]
    # 0.05 away can be true after as many seconds of full power, 12, but for the meter's tolerance
    refused = flags.count(Flag.BAD_MEASUREMENT)
    assert flags == [Flag.BAD_MEASUREMENT] * refused + [0] * (14 - refused)
    can = Capability.of(VEHICLE, optimal_line(VEHICLE.engine))
    assert refused == pytest.approx(0.05 / can.soc_per_s, abs=3)


@pytest.mark.parametrize(
    ("seconds", "flagged"),
    [
        ([0, 1, 2, 3], []),
        ([0, 1, 4, 5], []),  # two seconds were missed
        ([0, 1, 1, 2], [2]),
        ([0, 1, 0, 3], [2]),
        ([0, 1, 900, 3, 4], [2, 3]),  # a wild second, and the way back
        ([0, 1, -(2**31), 2**31 - 1, 4], [2, 3, 4]),
    ],
)
def test_a_wrong_clock_is_named_and_costs_no_plan(seconds, flagged) -> None:
    raw = Raw()
    outs = [raw.step(k, second=second) for k, second in enumerate(seconds)]
    assert [k for k, out in enumerate(outs) if out.flags & Flag.BAD_CLOCK] == flagged
    assert all(out.rung == 0 for out in outs)


def test_without_departure_the_rules_drive_while_the_solver_warms_up() -> None:
    raw = Raw()
    raw.library.init(raw.controller._state)
    outs = [(out.flags, out.rung) for out in (raw.step(k) for k in range(6))]
    assert outs == [(Flag.WARMING_UP, 2)] * 4 + [(0, 0)] * 2


def test_departure_refuses_bad_input_and_does_nothing_under_way() -> None:
    raw = Raw()
    controller, library = raw.controller, raw.library
    library.init(controller._state)
    raw.controller.inputs.fill(raw.trip.start, controller._in)
    controller._in.long_net_w[0] = math.nan
    assert library.depart(controller._state, ctypes.byref(controller._in)) == -1
    raw.step(0)
    controller._in.long_net_w[0] = 0.0
    assert library.depart(controller._state, ctypes.byref(controller._in)) == 0


def test_departure_cut_short_is_a_warm_start() -> None:
    raw = Raw()
    controller, library = raw.controller, raw.library
    library.init(controller._state)
    raw.controller.inputs.fill(raw.trip.start, controller._in)
    for _ in range(7):
        assert library.depart(controller._state, ctypes.byref(controller._in)) == 1
    outs = [raw.step(k) for k in range(6)]
    assert outs[-1].rung == 0


def test_state_forced_to_nan_is_noticed_and_the_controller_recovers() -> None:
    raw = Raw()
    raw.step(0)
    size = raw.library.state_bytes
    sizes = raw.library.values.sizes
    stage_bytes = (size // sizes.stages) // 8 * 8
    ctypes.memset(ctypes.byref(raw.controller._state, 2 * stage_bytes), 0xFF, stage_bytes)
    failed = raw.step(1)
    assert (failed.flags, failed.rung) == (Flag.SOLVER_FAILED, 1)
    rungs = [raw.step(k).rung for k in range(2, 8)]
    assert rungs[-1] == 0  # warmed up again


SPOILT = 10


def far_more_of_the_same(preview: Preview) -> Preview:
    """A preview that the car could drive: in each class of each block a day at full power."""
    long = preview.long
    full = np.full_like(long.net_w, VEHICLE.engine.power_max_w)
    return preview._replace(
        long=replace(
            long,
            duration_s=np.full_like(full, 1e5),
            net_w=full,
            internal_off_w=np.full_like(full, 2e4),
            free_net_w=full,
            free_internal_off_w=np.full_like(full, 2e4),
        )
    )


def decisions_with(altered, seconds: range, steps: int) -> list[Decision]:
    """Decisions of a run whose previews are altered in some seconds; C's equal Python's."""
    trip, ours, reference = pair("nycc")
    source = StageBuilder(VEHICLE, trip.truth, trip.forecast, ours.of_qp.horizon)

    def receive(step: int) -> Preview:
        preview = source.preview(step)
        return altered(preview) if step in seconds else preview

    ours.inputs.receive = receive
    reference.planner.preview.receive = receive
    decisions = []
    for mine, its in compare(trip, ours, reference, steps):
        assert_equal_decision(mine, its, power_w=1.0)
        decisions.append(mine)
    return decisions


def test_a_wild_second_of_the_preview_costs_no_plan() -> None:
    found = decisions_with(far_more_of_the_same, range(SPOILT, SPOILT + 1), SPOILT + 12)
    assert [bool(d.flags) for d in found] == [k in (SPOILT, SPOILT + 1) for k in range(SPOILT + 12)]
    assert all(d.flags in (0, BAD_PREVIEW) and not d.fallback for d in found)


def test_an_old_message_once_more_is_no_preview() -> None:
    frozen: list[Preview] = []

    def stale(preview: Preview) -> Preview:
        frozen.append(preview)
        return frozen[0]

    found = decisions_with(stale, range(SPOILT, SPOILT + 6), SPOILT + 8)
    # the pair asks twice a second; the first frozen message is that of its own second
    assert [k for k, d in enumerate(found) if d.flags] == list(range(SPOILT + 1, SPOILT + 6))
    assert not any(d.fallback for d in found)


def test_a_new_route_is_taken_from_its_second_second_on() -> None:
    longer = decisions_with(lambda p: _longer(p, 2.0), range(SPOILT, SPOILT + 9), SPOILT + 9)
    assert [k for k, d in enumerate(longer) if d.flags] == [SPOILT]
    plain = decisions_with(lambda p: p, range(0), SPOILT + 9)
    assert [d.on_share for d in longer[:SPOILT]] == [d.on_share for d in plain[:SPOILT]]
    assert [d.on_share for d in longer[SPOILT:]] != [d.on_share for d in plain[SPOILT:]]


def _longer(preview: Preview, factor: float) -> Preview:
    long = preview.long
    return preview._replace(long=replace(long, duration_s=factor * long.duration_s))


def test_when_solves_fail_again_and_again_both_start_cold(monkeypatch) -> None:
    # a day at full power in every block from now on, whose solution counts as not plausible
    strict = 300.0  # solver units: on this trip a plan stays below 100
    monkeypatch.setattr(base, "LARGEST_PLAUSIBLE", strict)
    monkeypatch.setitem(CONSTANTS[base.__name__], "LARGEST_PLAUSIBLE", strict)
    steps = SPOILT + PLAN_VALID_STEPS + 8
    found = decisions_with(far_more_of_the_same, range(SPOILT, steps), steps)
    failed = [bool(d.flags & Flag.SOLVER_FAILED) for d in found]
    assert sum(failed) > FAILURES_FORGIVEN
    assert found[-1].fallback == "rule-based"


def test_default_is_generated_c_where_it_can_be_and_osqp_elsewhere(monkeypatch) -> None:
    trip, in_c, in_python = Trip("nycc", VEHICLE), ("admm f64", "c"), ("osqp", "python")

    def made(**overrides: object) -> tuple[str, str]:
        controller = make_controller("mh-qp", trip, settings_of(**overrides))
        return controller.solver_name, controller.implementation

    assert made() == in_c
    assert made(mh_qp__implementation="python") == in_python
    no_blocks = {"mh_qp__horizon__blocks": 0, "mh_qp__horizon__block_s": 0}
    assert made(**no_blocks) == in_python
    with pytest.raises(InputError, match="blocks"):
        made(mh_qp__implementation="c", **no_blocks)
    with monkeypatch.context() as patch:
        patch.setattr("qpmpc.codegen.c_compiler.compiler", lambda: None)
        assert made() == in_python


def test_a_compiler_that_fails_is_named_and_the_default_does_without(monkeypatch, tmp_path) -> None:
    trip = Trip("nycc", VEHICLE)
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    for broken in ("/bin/false", "/bin/true"):
        monkeypatch.setenv("CC", broken)
        assert make_controller("mh-qp", trip).solver_name == "osqp"
        with pytest.raises(CodegenError, match=f"{broken} failed: .*mh_qp.implementation=python"):
            GeneratedController(trip)
    assert not list((tmp_path / "compiled").iterdir())


@pytest.mark.slow
def test_a_damaged_library_in_the_cache_is_built_again(tmp_path) -> None:
    # in processes of their own: one that has loaded a file takes it for loaded ever after
    trip = tmp_path / "trip.csv"
    trip.write_text("time_s,speed_mps\n" + "".join(f"{t},10\n" for t in range(8)))
    command = [sys.executable, "-m", "qpmpc", "simulate", str(trip), "--json", "-"]
    environment = os.environ | {"QPMPC_CACHE_DIR": str(tmp_path / "cache")}
    foreign = compiled({"other.c": "int other(void) { return 1; }\n"}).read_bytes()
    spoils = (
        lambda whole: whole[: len(whole) // 2],  # to load it would end the process by SIGBUS
        lambda whole: foreign,  # to load it would go well, to use it not
        lambda whole: whole,
    )
    for spoil in spoils:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert json.loads(done.stdout)["solver"]["implementation"] == "c"
        (library,) = (tmp_path / "cache" / "compiled").glob("*.so")
        assert library.stat().st_size > 1000
        library.write_bytes(spoil(library.read_bytes()))


# 30 s are cut into blocks of 5 s: six of them, and an empty seventh, in C as in Python.
def test_trip_too_short_for_its_blocks() -> None:
    speed_mps = load_cycle("nycc").speed_mps[488:519]  # from stop to stop
    assert speed_mps[0] == speed_mps[-1] == 0.0
    short = Cycle("short", np.arange(31.0), speed_mps, np.zeros(31))
    fuel = [
        simulate(short, "mh-qp", VEHICLE, settings={"mh_qp.implementation": chosen}).fuel_g
        for chosen in ("auto", "python")
    ]
    assert fuel[0] == pytest.approx(fuel[1], rel=1e-6)


def test_reset_on_the_road_costs_the_same_warm_up_as_in_python() -> None:
    trip, ours, reference = pair("nycc")
    state, rungs = trip.plant.initial_state(), []
    for k in range(260):
        if k == 200:
            ours.forget()
            reference.forget()
        seen = trip.observation(k, state)
        mine, its = (c.decide(seen) for c in (ours, reference))
        if k > 210:  # the rules, whose memory C has lost, drive the first seconds after the reset
            assert mine.command.p_eng_w == pytest.approx(its.command.p_eng_w, abs=1.0)
        assert (mine.fallback == "rule-based") == (its.fallback == "rule-based")
        rungs.append(mine.fallback)
        state, _ = trip.plant.step(state, its.command, seen.demand_w, seen.speed_mps)
    assert rungs.count("rule-based") == WARM_UP_STEPS - 1
