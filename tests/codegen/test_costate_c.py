"""`mh-costate` in generated C: equal to Python, one work each second, robust, small."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc import Cycle, Trip, load_cycle
from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import CodegenError, compiler
from qpmpc.codegen.costate_controller import GeneratedCostate
from qpmpc.codegen.firmware import missing_tools, symbols
from qpmpc.codegen.generate import project_files
from qpmpc.codegen.method import Method
from qpmpc.codegen.pil.loop import processor_in_the_loop
from qpmpc.controllers.mh_costate import MhCostate
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.costate.funnel import UNLIMITED, funnel
from qpmpc.costate.scan import scan
from qpmpc.errors import InputError
from qpmpc.faults.models import as_faults
from qpmpc.registry import make_controller
from qpmpc.vehicle import load_vehicle

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

FORBIDDEN = re.compile(r"malloc|calloc|free|sbrk|printf|puts|__aeabi_d|__aeabi_.*2d|recur")
CARS = ["paper-liion", "prius-nimh"]  # without and with a cost of starts, shortest runs and rests


@pytest.fixture(scope="module")
def road() -> Cycle:
    """Two minutes of NYCC, with stops, and its end: stages that are masked."""
    nycc = load_cycle("nycc")
    return Cycle.from_samples("part", np.arange(121.0), nycc.speed_mps[180:301])


def twin_of(trip: Trip, settings: ControllerSettings | None = None) -> RecedingHorizon:
    return RecedingHorizon(trip, MhCostate(trip, settings))


@pytest.mark.parametrize(
    ("car", "seconds", "blocks"),
    [
        ("paper-liion", 20, 20),
        ("prius-nimh", 20, 20),
        ("prius-prime", 20, 20),
        ("prius-nimh", 23, 7),
    ],
)
def test_every_decision_is_that_of_python(road, car, seconds, blocks):
    """Also in the seconds after a restart, and with a coolant that is held at its upper limit.

    23 stages and 21 after them leave lanes of the processor's vectors over, which have 20.
    """
    horizon = {"mh_costate.horizon.short_stages": seconds, "mh_costate.horizon.blocks": blocks}
    chosen = ControllerSettings().with_settings(horizon)
    vehicle = load_vehicle(car)
    if car == "paper-liion":
        vehicle = vehicle.with_settings({"trip.t_cl_init_degc": 89.5})
    trip = Trip(road, vehicle)
    ours, twin = GeneratedCostate(trip, chosen), twin_of(trip, chosen)
    twin.depart()
    compared = []

    def compare(seen, decision):
        expected = twin.decide(seen)
        compared.append((decision, expected))
        x, multipliers = ours.plan()
        last = twin.planner.last
        np.testing.assert_allclose(multipliers[:, 0], last.at.charge, rtol=1e-7)
        np.testing.assert_allclose(multipliers[:, 1], last.at.heat, atol=1e-7)
        np.testing.assert_allclose(x, last.x[:, : x.shape[1]], rtol=1e-6, atol=1e-5)
        if seen.step == 60:
            ours.forget()
            twin.forget()

    drive(trip, ours, on_step=compare)
    for decision, expected in compared:
        assert decision.command.engine_on == expected.command.engine_on
        assert decision.command.p_eng_w == pytest.approx(expected.command.p_eng_w, rel=1e-6)
        assert decision.on_share == pytest.approx(expected.on_share, abs=1e-7)
        assert decision.certificate_g == pytest.approx(expected.certificate_g, abs=1e-6)
    assert len(compared) > 100


@pytest.mark.parametrize("car", CARS)
def test_fuel_of_a_trip_is_that_of_python_and_of_single_precision(road, car):
    trip = Trip(road, car)
    ours, python = drive(trip, GeneratedCostate(trip)), drive(trip, twin_of(trip))
    assert ours.fuel_soc_balanced_g == pytest.approx(python.fuel_soc_balanced_g, rel=1e-6)
    whole = Trip("nycc", car)
    double, single = (drive(whole, GeneratedCostate(whole, None, p)) for p in ("f64", "f32"))
    assert single.fuel_soc_balanced_g == pytest.approx(double.fuel_soc_balanced_g, rel=2e-4)
    assert single.summary()["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}


@pytest.fixture(scope="module")
def library(road):
    return GeneratedCostate(Trip(road, "paper-nimh")).library


NO_PRICE = 2.0 * UNLIMITED


@settings(deadline=None, max_examples=200)
@given(st.data())
def test_the_funnel_takes_the_steps_of_python(library, data):
    """Also where the steps do not suffice, and where a limit is a point."""
    n = data.draw(st.integers(1, 40))
    steps = data.draw(st.integers(1, 3 * n))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    offset, response = rng.uniform(-1, 1, n), rng.uniform(0, 2, n) * (rng.random(n) < 0.7)
    low = np.where(rng.random(n) < 0.5, -1e3, rng.uniform(-2, 0, n))
    high = np.where(low < -10, 1e3, low + rng.uniform(0, 2, n) * (rng.random(n) < 0.8))
    terms = np.zeros((n + 1, 5))  # columns of a term: offset, response, limits, price
    terms[:n] = np.vstack([offset, response, low, high, np.full(n, NO_PRICE)]).T
    library.functions.mpc_costate_funnel(terms.ctypes.data_as(ctypes.c_void_p), n, steps)
    expected = funnel(offset, response, low, high, steps=steps)
    np.testing.assert_allclose(terms[:n, -1], expected, rtol=1e-8, atol=1e-8)


class Stretch(ctypes.Structure):
    """`mpc_costate_stretch`."""

    _fields_ = [
        *(
            (name, ctypes.c_double)
            for name in ["offset", "response", "decay", "limit", "side", "price", "jump"]
        ),
        ("at", ctypes.c_int32),
    ]


def scan_in_c(library, offset, response, limit, side, decay):
    """Multipliers by the generated scan, and the last stretch whose limit is met."""
    n = library.values.sizes.stages

    class Search(ctypes.Structure):
        """The head of `mpc_search`."""

        _fields_ = [
            ("term", ctypes.c_double * 5 * (n + 1)),
            ("stretch", Stretch * (n + 2)),
            ("met", ctypes.c_int32),
        ]

    search = Search()
    for i, of in enumerate(zip(offset, response, decay, limit, side, strict=True)):
        search.stretch[i + 1] = Stretch(*of)
    library.functions.mpc_costate_scan(ctypes.byref(search))
    found = np.zeros(n)
    for own in search.stretch[1 : search.met + 1]:
        found[own.at - 1] = own.jump
    return found, search.met


@settings(deadline=None, max_examples=200)
@given(st.data())
def test_the_scan_takes_the_steps_of_python(library, data):
    """Also with limits of both kinds, and terms that no price moves."""
    n = library.values.sizes.stages
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    offset, response = rng.uniform(-1, 1, n), rng.uniform(0, 2, n) * (rng.random(n) < 0.7)
    limit, decay = rng.uniform(-2, 2, n), rng.uniform(0.3, 1, n)
    shares = data.draw(st.sampled_from([(0.3, 0.7, 0.0), (0.3, 0.0, 0.7), (0.2, 0.4, 0.4)]))
    side = np.where(response > 0.0, rng.choice([0.0, 1.0, -1.0], n, p=shares), 0.0)
    problem = offset, response, limit, side, decay
    found, _ = scan_in_c(library, *problem)
    np.testing.assert_allclose(found, scan(*problem), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("met", [True, False])
def test_the_scan_has_steps_enough(library, met):
    """All limits are met, or all come and all go again, which takes each of its steps."""
    n = library.values.sizes.stages
    ones, decay = np.ones(n), np.full(n, 0.9)
    limit = np.cumsum(decay ** np.arange(n)) if met else np.full(n, -5.0)  # x by a price of 1
    found, last = scan_in_c(library, np.zeros(n), ones, limit, ones, decay)
    np.testing.assert_allclose(found, scan(np.zeros(n), ones, limit, ones, decay), atol=1e-8)
    assert (found > 0.0).all() if met else (found == 0.0).all()
    assert last == (n if met else 0)


@pytest.mark.parametrize("number", [1e31, 1e300, np.inf, -np.inf, np.nan])
def test_no_number_leads_the_scan_out_of_its_memory(library, number):
    """As by a flipped bit in the multipliers of the last second."""
    n = library.values.sizes.stages
    limit, ones, decay = np.full(n, -1.0), np.ones(n), np.full(n, 0.99)
    for at in (0, n // 2, n - 1):
        limit[at] = number
        _, last = scan_in_c(library, np.zeros(n), 0.01 * ones, limit, ones, decay)
        assert 0 <= last <= n
        with np.errstate(all="ignore"):
            assert len(scan(np.zeros(n), 0.01 * ones, limit, ones, decay)) == n


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_its_powers_are_those_of_numpy(road, precision):
    """To round-off times the logarithm of the result."""
    made = GeneratedCostate(Trip(road, "paper-nimh"), None, precision).library
    function, real = made.functions.mpc_fixed_pow, made.real
    function.argtypes, function.restype = [real, real], real
    relative = 64.0 * float(np.finfo(real).eps)
    for x in (0.0, 1e-12, 1e-3, 0.3, 0.999, 1.0, 1.001, 1.7, 40.0):
        for y in (0.5, 1.0, 1.35, 3.0):
            assert function(x, y) == pytest.approx(x**y, rel=relative, abs=1e-15)


def test_two_controllers_side_by_side_decide_as_alone(road):
    trip = Trip(road, "paper-nimh")
    alone = drive(trip, GeneratedCostate(trip)).trajectory.p_eng_w
    one, other = GeneratedCostate(trip), GeneratedCostate(trip)
    other.depart()

    def interleave(seen, _):
        if seen.step % 3:
            other.step(seen)

    np.testing.assert_array_equal(drive(trip, one, on_step=interleave).trajectory.p_eng_w, alone)


def test_a_solver_that_fails_and_a_restart_are_survived(road):
    trip = Trip(road, "prius-nimh")
    faults = as_faults(
        [
            {"kind": "solver-failure", "at_s": 20, "for_s": 8},
            {"kind": "reset", "at_s": 60},
        ]
    )
    run = drive(trip, make_controller("mh-costate", trip), faults=faults)
    assert run.summary()["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
    fallback = [k for k, rung in enumerate(run.trajectory.fallback) if rung]
    assert fallback == list(range(20, 28))  # none after the restart: its first plan is used


FIELDS = ("soc", "t_cl_degc", "demand_w", "speed_mps", "short_demand_w", "long_net_w", "long_rises")


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_numbers_that_are_none_reach_no_command(road, precision):
    """In inputs and in the iterate in memory; some seconds later all is well again."""
    trip = Trip(road, "prius-nimh")
    ours = GeneratedCostate(trip, None, precision)
    state = trip.plant.initial_state()
    ours.depart()
    values = ours.library.values
    for k in range(60):
        seen = trip.observation(k, state)
        ours.inputs.fill(seen, ours._in)
        wrong = FIELDS[k // 4] if k % 4 == 0 and k // 4 < len(FIELDS) else ""
        if wrong:
            field = getattr(ours._in, wrong)
            if isinstance(field, float):
                setattr(ours._in, wrong, float("nan"))
            else:
                field[3] = float("nan")
        if k == 40:  # all of the stages' memory, a magic number at each end left
            bytes_, real = ours.library.state_bytes, ours.library.real
            size = ctypes.sizeof(real) * values.sizes.stages * 40
            start = bytes_ // 8
            (ctypes.c_ubyte * size).from_buffer(ours._state, start)[:] = [255] * size
        ours.library.step(*ours._arguments)
        out = ours._out
        assert np.isfinite([out.p_eng_w, out.on_share, out.relaxation_gap]).all()
        assert 0.0 <= out.p_eng_w <= trip.vehicle.engine.power_max_w
        assert bool(out.flags) >= bool(wrong)
        decision = ours._decision()
        state, _ = trip.plant.step(state, decision.command, seen.demand_w, seen.speed_mps)
    assert (out.rung, out.flags) == (0, 0)


def test_a_project_has_nothing_of_the_qp():
    values = Method.of("mh-costate", ControllerSettings()).values(load_vehicle(), None)
    files = project_files(values, "cortex-m7", "f32")
    assert not {"mpc_qp.c", "mpc_admm.c", "mpc_polish.c", "mpc_rows_factor.h"} & set(files)
    readme = files["README.md"]
    for name in files:
        if name.endswith(".c"):
            assert f"`{name}`" in readme or f"`{name[:-1]}*`" in readme, name
    generated = files.pop("mpc_constants.h")
    code = "".join(text for name, text in files.items() if name.endswith((".c", ".h")))
    for names in values.constants.values():
        for name in names:
            assert f"#define {name} " in generated
            assert re.search(rf"\b{name}\b", code), f"{name} is not used"
    assert max(len(text.splitlines()) for n, text in files.items() if "costate" in n) < 250


def test_which_implementation_runs(road, monkeypatch):
    trip = Trip(road, "paper-nimh")

    def made(name):
        chosen = ControllerSettings().with_settings({"mh_costate.implementation": name})
        return make_controller("mh-costate", trip, chosen)

    assert isinstance(made("auto"), GeneratedCostate)
    assert made("python").implementation == "python"
    monkeypatch.setattr("qpmpc.codegen.c_compiler.compiler", lambda: None)
    fallen = made("auto")
    assert fallen.implementation == "python"
    assert any("mh_costate.implementation=python" in line for line in fallen.remarks)
    with pytest.raises(CodegenError, match="no C compiler"):
        made("c")


def test_what_does_not_fit_generated_code_is_refused():
    def values(horizon, engine):
        chosen = ControllerSettings().with_settings(horizon)
        vehicle = load_vehicle().with_settings(engine)
        return Method.of("mh-costate", chosen).values(vehicle, None)

    with pytest.raises(InputError, match=r"mh_costate\.horizon\.blocks"):
        values({"mh_costate.horizon.blocks": 0}, {})
    with pytest.raises(InputError, match="min_on_s=50"):
        values({"mh_costate.horizon.short_stages": 60}, {"engine.min_on_s": 50})
    longest = values({}, {"engine.min_on_s": 50}).costate
    assert (longest["RUN_STATES"], longest["REST_STATES"]) == (21, 2)


def documented(car: str) -> list[float]:
    """Instructions, flash and RAM of docs/embedded.md, of the default horizon in f32."""
    text = (Path(__file__).parents[2] / "docs" / "embedded.md").read_text("utf-8")
    row = re.search(rf"^\| `{car}`[^|]*\| f32 \| 80 \(default\) \| \d \|(.+)\|$", text, re.M)
    assert row
    return [float(cell.replace(",", "")) for cell in row[1].split("|")]


@pytest.mark.skipif(bool(missing_tools()), reason="no ARM tools")
@pytest.mark.parametrize("car", ["paper-nimh", "prius-nimh"])
def test_firmware_does_the_same_work_every_second(car, tmp_path):
    """Thermostat open at first and closed later; the first second too."""
    hot = {"trip.t_cl_init_degc": 85.0}
    nycc = load_cycle("nycc")
    part = Cycle.from_samples("part", np.arange(61.0), nycc.speed_mps[180:241])
    trip = Trip(part, load_vehicle(car).with_settings(hot))
    result = processor_in_the_loop(trip, controller="mh-costate")
    data = result.summary()
    assert data["instructions"]["spread_percent"] <= 0.1
    for figure, found in zip(
        documented(car),
        (data["instructions"]["median"], data["flash_bytes"], data["ram_bytes"]),
        strict=True,
    ):
        assert found == pytest.approx(figure, rel=0.03)  # for other compilers
    assert data["departure"]["instructions_max"] <= data["instructions"]["max"]
    assert data["stack_bytes"] <= data["stack_bytes_call_graph"] + 128
    assert data["fallback_steps"] == 0
    assert data["on_off_flips"] == []
    assert data["algorithm"] == "costate"


@pytest.mark.skipif(bool(missing_tools()), reason="no ARM tools")
def test_image_has_no_allocation_no_output_and_no_soft_double(tmp_path):
    from qpmpc.codegen.firmware import build_firmware

    values = Method.of("mh-costate", ControllerSettings()).values(load_vehicle(), None)
    names = symbols(build_firmware(values, "f32", Path(tmp_path)))
    assert "mpc_step" in names
    assert [name for name in names if FORBIDDEN.search(name)] == []
