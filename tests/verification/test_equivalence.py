"""Three renderings of the QP are one, and every way of telling them apart works."""

from dataclasses import replace

import numpy as np
import pytest

from qpmpc.controllers.factory import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import QpmpcError
from qpmpc.preview import StageBuilder, Trace
from qpmpc.qp import CvxpyTwin, Var
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.verification.cvxpy_matrices import cvxpy_matrices
from qpmpc.verification.equivalence import (
    QpCase,
    Renderings,
    check_equivalence,
    random_cases,
    recorded_cases,
)
from qpmpc.verification.matrices import Matrices, difference, matrices_of

VEHICLE = load_vehicle()
ROUNDING = 1e-12
OPTIMUM = 1e-6


def beginning(name: str, steps: int) -> Cycle:
    whole = load_cycle(name)
    inside = slice(steps + 1)
    return Cycle(name, whole.time_s[inside], whole.speed_mps[inside], whole.grade[inside])


def made(
    vehicle: Vehicle = VEHICLE, changes: dict[str, object] | None = None
) -> tuple[Renderings, list[QpCase]]:
    """Renderings of a trip with its departure and two cases that no trip meets."""
    settings = ControllerSettings().with_settings(changes or {})
    cycle = beginning("udds", 250)
    truth = Trace.of(cycle, vehicle)
    preview = StageBuilder(vehicle, truth, truth, settings.mh_qp.horizon)
    departure = next(recorded_cases(cycle, vehicle, preview, settings, every=250))
    cases = [departure, *random_cases(preview, vehicle, 2, 7)]
    return Renderings(vehicle, preview, settings), cases


def assert_equal(renderings: Renderings, case: QpCase) -> None:
    found = renderings.compare(case)
    assert found.cvxpy_matrices < ROUNDING
    assert found.casadi_matrices < ROUNDING
    assert found.cvxpy_optimum < OPTIMUM
    assert found.casadi_optimum < OPTIMUM
    assert found.cvxpy_violation < OPTIMUM
    assert found.casadi_violation < OPTIMUM


def test_recorded_and_random_cases() -> None:
    equivalence = check_equivalence(beginning("nycc", 150), VEHICLE, every=15, random=14)
    assert equivalence.to_dict()["cases"] == 24
    worst = equivalence.worst()
    assert max(worst.cvxpy_matrices, worst.casadi_matrices) < ROUNDING
    assert max(worst.cvxpy_optimum, worst.casadi_optimum) < OPTIMUM
    assert max(worst.cvxpy_violation, worst.casadi_violation) < OPTIMUM


@pytest.mark.parametrize(
    ("vehicle_changes", "changes"),
    [
        # every branch of the rows: least engine power, fading cabin heat, early reserve
        ({"engine.power_min_w": 3000.0, "battery.power_discharge_max_w": 9000.0}, {}),
        ({"thermal.cabin_heat_from_degc": 35.0, "thermal.cabin_heat_full_degc": 55.0}, {}),
        ({}, {"mh_qp.qp.soc_penalty_g": 500.0}),
        ({}, {"mh_qp.qp.soc_reserve": 0.0, "mh_qp.scaling.duration_exponent": 0.0}),
        ({"trip.soc_init": 0.45}, {"mh_qp.horizon.classes": 1, "mh_qp.qp.terminal_low": 0.99}),
    ],
)
def test_other_settings(vehicle_changes: dict[str, object], changes: dict[str, object]) -> None:
    renderings, cases = made(VEHICLE.with_settings(vehicle_changes), changes)
    for case in cases[:2]:
        assert_equal(renderings, case)


def test_twin_is_compiled_once_and_updated() -> None:
    renderings, cases = made()
    twin = renderings.twin
    assert twin.problem.is_dpp()
    values = []
    later = replace(cases[0], soc=0.58, t_cl_degc=47.0)
    for case in (cases[0], later, cases[0]):
        data = renderings.qp.update(case.stages, case.soc, case.t_cl_degc, case.about)
        twin.update(case.stages, case.soc, case.t_cl_degc, case.about, data.scaling)
        ours = matrices_of(renderings.qp.structure, data)
        assert difference(ours, cvxpy_matrices(twin), data.scaling.column) < ROUNDING
        values.append(ours.value(twin.solve().ravel()))
    assert values[0] == pytest.approx(values[2], rel=1e-6)
    assert values[0] != pytest.approx(values[1], rel=1e-3)


def test_twin_plans_as_the_product_does_without_regularisation() -> None:
    renderings, cases = made()
    case = cases[0]
    renderings.twin.update(case.stages, case.soc, case.t_cl_degc, case.about)
    x = renderings.twin.solve()
    assert x.shape == (renderings.qp.stages, len(Var))
    counts = case.stages.duration_s > 0.0
    assert np.all(x[counts, Var.ON] < 1.0 + 1e-6)
    assert np.all(x[counts, Var.ON] > -1e-6)
    data = renderings.qp.update(case.stages, case.soc, case.t_cl_degc, case.about)
    ours = matrices_of(renderings.qp.structure, data)
    assert ours.violation(x.ravel(), data.scaling.column) < 1e-6


def test_twin_says_when_there_is_no_optimum() -> None:
    renderings, cases = made()
    case = cases[0]
    twin = renderings.twin
    twin.update(case.stages, case.soc, case.t_cl_degc, case.about)
    impossible = CvxpyTwin(VEHICLE, renderings.qp.model, renderings.qp.stages)
    impossible.update(case.stages, case.soc, case.t_cl_degc, case.about)
    impossible.constraints.append(impossible.soc[-1] >= 2.0)
    impossible.problem = type(twin.problem)(impossible.objective, impossible.constraints)
    with pytest.raises(QpmpcError, match="infeasible"):
        impossible.solve()


def changed(matrices: Matrices, part: str, entry: tuple[int, ...], factor: float) -> Matrices:
    array = getattr(matrices, part).copy()
    array[entry] = array[entry] * factor + (array[entry] == 0.0)
    return replace(matrices, **{part: array})


def test_difference_sees_any_entry_but_not_order_sign_or_scale() -> None:
    renderings, cases = made()
    case = cases[2]
    data = renderings.qp.update(case.stages, case.soc, case.t_cl_degc, case.about)
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
