"""Four renderings of the QP are one, and every way of telling them apart works."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import qpmpc.verification.renderings.equivalence
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import QpmpcError
from qpmpc.qp import CvxpyTwin, Var
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.verification.problems.recorder import record
from qpmpc.verification.renderings.cvxpy_matrices import cvxpy_matrices
from qpmpc.verification.renderings.equivalence import Renderings, check_equivalence
from qpmpc.verification.renderings.generated_qp import READ
from qpmpc.verification.renderings.matrices import Matrices, difference, matrices_of
from qpmpc.verification.renderings.qp_cases import QpCase, random_cases, recorded_cases

VEHICLE = load_vehicle("paper-nimh")  # `test_other_settings` has engines whose starts cost
ROUNDING = 1e-12
OPTIMUM = 1e-6
ALL = {"cvxpy"} | ({"c"} if compiler() is not None else set())


def beginning(name: str, steps: int) -> Cycle:
    whole = load_cycle(name)
    inside = slice(steps + 1)
    return Cycle(name, whole.time_s[inside], whole.speed_mps[inside], whole.grade[inside])


def made(
    vehicle: Vehicle = VEHICLE, changes: dict[str, object] | None = None
) -> tuple[Renderings, list[QpCase]]:
    """Renderings of a trip with its departure and two cases that no trip meets."""
    settings = ControllerSettings().with_settings(changes or {})
    trip = Trip(beginning("udds", 250), vehicle)
    renderings = Renderings(trip, settings)
    departure = next(recorded_cases(trip, settings, every=250))
    stages = renderings.preview.count
    return renderings, [departure, *random_cases(trip, stages, 2, 7)]


@cache
def usual() -> tuple[Renderings, list[QpCase]]:
    """Those of the default settings, made once: every use updates all that it reads."""
    return made()


def assert_equal(renderings: Renderings, case: QpCase) -> None:
    found = renderings.compare(case)
    assert set(found) == ALL
    for name, off in found.items():
        assert off.matrices < ROUNDING, name
        assert off.optimum < OPTIMUM, name
        assert off.violation < OPTIMUM, name


@pytest.mark.slow
def test_recorded_and_random_cases() -> None:
    equivalence = check_equivalence(Trip(beginning("nycc", 150), VEHICLE), every=50, random=4)
    assert equivalence.to_dict()["cases"] == 7
    worst = equivalence.worst()
    assert set(worst) == ALL
    for name, off in worst.items():
        assert off.matrices < ROUNDING, name
        assert max(off.optimum, off.violation) < OPTIMUM, name


def test_recorded_cases_are_the_qps_of_the_road() -> None:
    """Made again from state and plan, they are bit for bit what `mh-qp` gave its solver."""
    trip, settings = Trip(beginning("nycc", 60), VEHICLE), ControllerSettings()
    solved = [qp.data for qp in record(trip, settings).on_the_road]
    renderings = Renderings(trip, settings)
    cases = list(recorded_cases(trip, settings, every=7))
    assert [case.seen.step for case in cases] == list(range(0, 60, 7))
    for case in cases:
        data, theirs = renderings.qp.update(*renderings.inputs(case)), solved[case.seen.step]
        for part in ("q", "a_data", "lower", "upper"):
            np.testing.assert_array_equal(getattr(data, part), getattr(theirs, part))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle_changes", "changes"),
    [
        # every branch of the rows: least power, derated battery, fading cabin heat, early reserve
        (
            {
                "engine.power_min_w": 3000.0,
                "battery.power_discharge_max_w": 9000.0,
                "battery.derating_share_per_k": 0.02,
            },
            {},
        ),
        ({"thermal.cabin_heat_from_degc": 35.0, "thermal.cabin_heat_full_degc": 55.0}, {}),
        ({}, {"mh_qp.qp.soc_penalty_g": 500.0}),
        ({}, {"mh_qp.qp.soc_reserve": 0.0, "mh_qp.scaling.duration_exponent": 0.0}),
        ({"trip.soc_init": 0.45}, {"mh_qp.horizon.classes": 1, "mh_qp.qp.terminal_low": 0.99}),
        ({"engine.power_min_w": 3000.0, "engine.electric_max_mps": 5.0}, {}),
        ({"engine.start_fuel_g": 0.3}, {}),
        ({"engine.start_energy_j": 4000.0}, {}),
        ({"engine.start_fuel_g": 0.2, "engine.start_energy_j": 4000.0}, {}),
    ],
)
def test_other_settings(vehicle_changes: dict[str, object], changes: dict[str, object]) -> None:
    renderings, cases = made(VEHICLE.with_settings(vehicle_changes), changes)
    for case in cases[: 3 if renderings.qp.table.has_start else 2]:  # the engine on and off now
        assert_equal(renderings, case)


@pytest.mark.slow
@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(
    ("file", "old", "new", "part"),
    [
        ("mpc_rows_admm.h", "(a->battery[i].on * x[MPC_VAR_ON])", "x[MPC_VAR_ON]", "matrices"),
        ("mpc_rows_admm.h", "b->t_cl_max_high", "REAL(1.0e30)", "matrices"),
        (
            "mpc_rows_values.h",
            "q[MPC_VAR_T_SLACK] += cal->",
            "q[MPC_VAR_T_SLACK] -= cal->",
            "matrices",
        ),
        # the solver's own work: the matrix is right, what is found with it is not
        ("mpc_rows_admm.h", "m_fuel_fuel += a->fuel[i].fuel * a->fuel[i].fuel;", "", "optimum"),
    ],
)
def test_c_that_differs_is_noticed(monkeypatch, file, old, new, part) -> None:
    project_files = qpmpc.verification.renderings.generated_qp.project_files

    def spoilt(*arguments: object) -> dict[str, str]:
        files = project_files(*arguments)
        assert files[file].count(old) >= 1
        files[file] = files[file].replace(old, new, 1)
        return files

    generated_qp = qpmpc.verification.renderings.generated_qp
    monkeypatch.setattr(generated_qp, "project_files", spoilt)
    monkeypatch.setattr(generated_qp, "SLICES", 30)  # it may never converge
    renderings, cases = made()
    off = renderings.compare(cases[1])["c"]
    if part == "matrices":
        assert not off.matrices < ROUNDING
    else:
        assert off.matrices < ROUNDING
        assert not np.max([off.optimum, off.violation]) < OPTIMUM


def test_nothing_of_the_reader_is_in_a_generated_controller() -> None:
    root = Path(qpmpc.codegen.__file__).parent
    for file in READ:
        assert "reader" not in (root / "runtime" / file).read_text("utf-8")


def test_without_a_compiler_the_others_are_compared(monkeypatch) -> None:
    monkeypatch.setattr(qpmpc.verification.renderings.equivalence, "compiler", lambda: None)
    renderings, cases = made()
    assert set(renderings.compare(cases[0])) == {"cvxpy"}


def test_twin_is_compiled_once_and_updated() -> None:
    renderings, cases = usual()
    twin = renderings.twin
    assert twin.problem.is_dpp()
    values = []
    seen = cases[0].seen._replace(soc=0.58, t_cl_degc=47.0)
    later = replace(cases[0], seen=seen)
    for case in (cases[0], later, cases[0]):
        data = renderings.qp.update(*renderings.inputs(case))
        twin.update(*renderings.inputs(case), data.scaling)
        ours = matrices_of(renderings.qp.structure, data)
        assert difference(ours, cvxpy_matrices(twin), data.scaling.column) < ROUNDING
        values.append(ours.value(twin.solve().ravel()))
    assert values[0] == pytest.approx(values[2], rel=1e-6)
    assert values[0] != pytest.approx(values[1], rel=1e-3)


def test_twin_plans_as_the_product_does_without_regularisation() -> None:
    renderings, cases = usual()
    inputs = renderings.inputs(cases[0])
    renderings.twin.update(*inputs)
    x = renderings.twin.solve()
    assert x.shape == (renderings.qp.stages, len(renderings.qp.table.variables))
    counts = inputs[0].duration_s > 0.0
    assert np.all(x[counts, Var.ON] < 1.0 + 1e-6)
    assert np.all(x[counts, Var.ON] > -1e-6)
    data = renderings.qp.update(*inputs)
    ours = matrices_of(renderings.qp.structure, data)
    assert ours.violation(x.ravel(), data.scaling.column) < 1e-6


def test_twin_says_when_there_is_no_optimum() -> None:
    renderings, cases = usual()
    inputs = renderings.inputs(cases[0])
    twin = renderings.twin
    twin.update(*inputs)
    impossible = CvxpyTwin(VEHICLE, renderings.qp.model, renderings.qp.stages)
    impossible.update(*inputs)
    impossible.constraints.append(impossible.soc[-1] >= 2.0)
    impossible.problem = type(twin.problem)(impossible.objective, impossible.constraints)
    with pytest.raises(QpmpcError, match="infeasible"):
        impossible.solve()


def changed(matrices: Matrices, part: str, entry: tuple[int, ...], factor: float) -> Matrices:
    array = getattr(matrices, part).copy()
    array[entry] = array[entry] * factor + (array[entry] == 0.0)
    return replace(matrices, **{part: array})


def test_difference_sees_any_entry_but_not_order_sign_or_scale() -> None:
    renderings, cases = usual()
    case = cases[2]
    data = renderings.qp.update(*renderings.inputs(case))
    column = data.scaling.column
    one = matrices_of(renderings.qp.structure, data)
    rng = np.random.default_rng(3)
    order = rng.permutation(len(one.upper))
    factor = rng.uniform(0.1, 10.0, len(order))
    other = replace(
        one,
        upper=one.upper[order] * factor[:, None],
        upper_to=one.upper_to[order] * factor,
        equal=-one.equal[::-1],
        equal_to=-one.equal_to[::-1],
    )
    assert difference(one, other, column) < ROUNDING
    for part in ("gradient", "equal_to", "upper_to", "equal", "upper", "hessian"):
        array = getattr(one, part)
        size = np.abs(array * column if part in ("gradient", "equal", "upper") else array)
        entry = np.unravel_index(int(size.argmax()), array.shape)
        wrong = changed(one, part, tuple(int(i) for i in entry), 1.001)
        assert difference(one, wrong, column) > 1e-8, part
    fewer = replace(one, upper=one.upper[1:], upper_to=one.upper_to[1:])
    assert difference(one, fewer, column) == np.inf
