"""The table of rows: what it says is the model; what it cannot say is refused; docs show it."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.preview import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp, Var
from qpmpc.qp.expressions import FormulaError, code_of, expression, parsed, terms_of
from qpmpc.qp.quantities import INPUTS, ORIGIN
from qpmpc.qp.rows import COST, ROWS, VARIABLES, Entry, Row, Rows, Table, table_of
from qpmpc.qp.rows import QUANTITIES as LINES
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.must_run import must_run
from qpmpc.verification.independent.equations import Equations

CAR = load_vehicle("paper-nimh")  # its starts cost nothing
MODEL = PwaModel.of(CAR)
EQUATIONS = Equations(CAR)
STARTING = CAR.with_settings({"engine.start_fuel_g": 0.3, "engine.start_energy_j": 4e3})
DOCS = Path(__file__).parents[2] / "docs" / "qp.md"


def in_si_units(stages, about, soc, t_cl_degc, car=CAR, engine_on=False):
    """Rows of the QP in SI units as (stages, rows, stages, variables), and their bounds."""
    n = len(stages.duration_s)
    qp = StageQp(car, MODEL, n, QpSettings(), ScalingSettings())
    data = qp.update(stages, soc, t_cl_degc, about, engine_on)
    a = qp.structure.matrix_of(data.a_data).toarray()
    a /= data.scaling.row[:, None] * data.scaling.column
    shape = n, qp.rows.count
    lower, upper = (
        b.reshape(shape) for b in (data.lower / data.scaling.row, data.upper / data.scaling.row)
    )
    return a.reshape(*shape, n, -1), lower, upper, qp.rows


def two_stages(h, net_w, speed_mps, t_degc, fuel, power):
    """The same stage twice, expanded about one point; the second has a stage before it."""
    pair = np.ones(2)
    off_w = EQUATIONS.internal_w(CAR.trip.soc_init, net_w)
    stages = Stages(
        h * pair,
        net_w * pair,
        speed_mps * pair,
        float(off_w) * pair,
        must_run(CAR, net_w, speed_mps) * pair,
        net_w * pair,
        float(off_w) * pair,
        pair,
        0.0 * pair,
        0.0 * pair,
    )
    at = t_degc * pair
    return stages, Linearisation(at, fuel * pair, power * pair, at, at)


@settings(max_examples=60, deadline=None)
@given(
    h=st.floats(1.0, 120.0),
    speed_mps=st.floats(0.0, 35.0),
    t_degc=st.floats(30.0, 84.0),
    fuel=st.floats(0.0, 3.0),
    power=st.floats(0.0, 40e3),
)
def test_coolant_row_is_the_derivative_of_the_heat_balance(h, speed_mps, t_degc, fuel, power):
    """T = T_end(q(T_mean, F, E), T_before) to first order, by differences of the equations."""
    stages, about = two_stages(h, 5e3, speed_mps, t_degc, fuel, power)
    a, lower, _, rows = in_si_units(stages, about, 0.6, t_degc)
    row = rows.first("t_cl")
    th, lhv = CAR.thermal, EQUATIONS.lhv_j_per_g
    alpha, slope = float(MODEL.alpha(t_degc)), float(MODEL.alpha.active_slope(t_degc))

    def end(t_end: float, t_before: float, burnt: float, driven: float) -> float:
        mean = 0.5 * (t_end + t_before)
        cold = alpha * burnt + slope * fuel * (mean - t_degc)
        heat = (1.0 - th.exhaust_share) * (lhv * cold - driven)
        heat -= float(EQUATIONS.ua_w_per_k(speed_mps)) * (mean - th.t_amb_degc)
        heat -= float(EQUATIONS.cabin_w(t_degc))
        return EQUATIONS.coolant_after_degc(h, t_before, heat)

    point = np.array([t_degc, t_degc, fuel, power])
    at_point = end(*point)
    places = [(1, Var.T_CL), (0, Var.T_CL), (1, Var.FUEL), (1, Var.P_ENG)]
    table = np.array([a[1, row, k, var] for k, var in places])
    for i, step in enumerate((1e-4, 1e-4, 1e-4, 1.0)):
        by = np.eye(4)[i] * step
        up, down = (end(*(point + by)) - at_point) / step, (at_point - end(*(point - by))) / step
        residual = float(i == 0) - table[i]  # T - T_end, of which the first is in the row too
        low, high = min(up, down), max(up, down)  # apart where the thermostat just opens
        assert low - 1e-5 * (1.0 + abs(low)) <= residual <= high + 1e-5 * (1.0 + abs(high))
    assert table @ point == pytest.approx(t_degc - at_point + lower[1, row], abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(h=st.floats(0.0, 120.0), net_w=st.floats(-30e3, 60e3), data=st.data())
def test_other_rows_hold_exactly_where_the_model_allows(h, net_w, data):
    """Fuel, battery and power limits at points of the model: slack of each piece, by hand."""
    stages, about = two_stages(h, net_w, 10.0, 60.0, 0.5, 8e3)
    free_w = data.draw(st.sampled_from([net_w, net_w - 4e3]))
    free_off_w = float(EQUATIONS.internal_w(CAR.trip.soc_init, free_w))
    free = {"free_net_w": free_w, "free_internal_off_w": free_off_w}
    stages = replace(stages, **{name: np.full(2, value) for name, value in free.items()})
    a, lower, upper, rows = in_si_units(stages, about, 0.6, 60.0)
    x = np.zeros((2, a.shape[-1]))
    x[0, Var.SOC] = data.draw(st.floats(0.4, 0.8))
    on = x[1, Var.ON] = data.draw(st.floats(0.0, 1.0))
    power = x[1, Var.P_ENG] = on * data.draw(st.floats(0.0, 50e3))
    # the engine takes the seconds without a choice first: what it leaves is the mean of the others
    taken_w = net_w - (1.0 - on) * free_w
    pieces = MODEL.battery.slope * (taken_w - power) + MODEL.battery.intercept * on
    x[1, Var.INTERNAL] = pieces.max() + (1.0 - on) * free_off_w
    x[1, Var.FUEL] = (MODEL.fuel.slope * power + MODEL.fuel.intercept * on).max()
    x[1, Var.SOC] = x[0, Var.SOC] - h * x[1, Var.INTERNAL] / MODEL.battery_energy_j
    over = np.einsum("rkv,kv->r", a[1], x) - lower[1]
    assert over[rows.first("soc")] == pytest.approx(0.0, abs=1e-12)
    assert over[rows["fuel"]].min() == pytest.approx(0.0, abs=1e-9)
    assert over[rows["battery"]].min() == pytest.approx(0.0, abs=1e-6)
    most = min(CAR.engine.power_max_w, net_w + CAR.battery_charge_max_w)
    room = (
        upper[1, rows.first("p_eng_max")] - np.einsum("rkv,kv->r", a[1], x)[rows.first("p_eng_max")]
    )
    assert room == pytest.approx(most * on - power, abs=1e-6)
    missing = max(net_w - CAR.battery_discharge_max_w - CAR.engine.power_min_w, 0.0)
    above = power - CAR.engine.power_min_w * on - missing
    assert over[rows.first("p_eng_min")] == pytest.approx(above, abs=1e-6)


def test_every_name_of_the_table_is_known() -> None:
    numbers = qp_parameters(STARTING, MODEL, QpSettings(), ScalingSettings())
    qp = StageQp(STARTING, MODEL, 2, QpSettings(), ScalingSettings())
    known = qp._quantities._names.keys() | set(INPUTS) | set(ORIGIN) | numbers.keys()
    known |= {t.id for line in parsed(LINES) for t in ast.walk(line) if isinstance(t, ast.Name)}
    assert {variable.unit for variable in VARIABLES.values()} - {"1.0"} <= numbers.keys()
    for row in ROWS:
        for formula in (*row.terms.values(), row.low, row.high):
            names = (
                {n.id for n in ast.walk(formula) if isinstance(n, ast.Name)} if formula else set()
            )
            assert names <= known, row.name
    assert set(VARIABLES) == set(Var)
    free, starting = table_of(CAR.engine), table_of(STARTING.engine)
    assert free.states == starting.states == free.coupling == [Var.SOC, Var.T_CL]
    assert starting.coupling == [Var.SOC, Var.T_CL, Var.ON]
    cost = {Var.FUEL, Var.T_CL, Var.T_SLACK}
    assert {entry.var for entry in free.cost} == cost
    assert {entry.var for entry in starting.cost} == cost | {Var.START}


def test_an_engine_that_starts_at_no_cost_has_no_trace_of_starts() -> None:
    free = table_of(CAR.engine)
    assert free.variables == tuple(Var)[:-1]
    assert [row.name for row in free.rows] == [row.name for row in ROWS][:-2]
    assert all(entry.var is not Var.START for row in free.rows for entry in row.terms)


@pytest.mark.parametrize(
    ("fuel", "energy", "rows"),
    [(True, False, {"t_cl"}), (False, True, {"soc"}), (True, True, {"t_cl", "soc"})],
)
def test_a_start_is_in_the_rows_of_what_it_takes(fuel, energy, rows) -> None:
    table, start = Table(fuel, energy), Entry(Var.START, False)
    assert {row.name for row in table.rows if start in row.terms} == rows | {"start", "box_start"}
    assert (start in table.cost) is fuel


@settings(max_examples=40, deadline=None)
@given(
    h=st.floats(1.0, 120.0),
    rises=st.floats(-20.0, 20.0),
    shares=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    engine_on=st.booleans(),
)
def test_starts_are_what_the_on_share_rises_and_take_fuel_heat_and_charge(
    h, rises, shares, engine_on
) -> None:
    stages, about = two_stages(h, 5e3, 10.0, 60.0, 0.5, 8e3)
    stages = replace(stages, rises=np.array([1.0, rises]))
    a, lower, _, rows = in_si_units(stages, about, 0.6, 60.0, STARTING, engine_on)
    x = np.zeros((2, len(Var)))
    x[:, Var.ON] = shares
    left = np.einsum("krlv,lv->kr", a, x)
    row = rows.first("start")
    least = (lower - left)[:, row]  # of START
    expected = [shares[0] - engine_on, rises * (shares[1] - shares[0])]
    assert least == pytest.approx(expected, abs=1e-9)
    np.testing.assert_allclose(a[1, [row, rows.first("box_start")], 1, Var.START], 1.0)
    # against the equations: 0.3 g burnt within the stage, 4 kJ and their loss out of the store
    thermal, engine = CAR.thermal, STARTING.engine
    heat_j = (1.0 - thermal.exhaust_share) * engine.start_fuel_g * engine.lhv_j_per_g
    t_cl = a[1, rows.first("t_cl"), 1]
    per_w = t_cl[Var.P_ENG] / (1.0 - thermal.exhaust_share)
    assert t_cl[Var.START] == pytest.approx(-per_w * heat_j / h)
    taken_j = a[1, rows.first("soc"), 1, Var.START] * MODEL.battery_energy_j
    aux_w, soc = CAR.battery.aux_power_w, CAR.trip.soc_init
    drawn = EQUATIONS.internal_w(soc, np.array([aux_w, aux_w + engine.start_energy_j]))
    assert taken_j == pytest.approx(drawn[1] - drawn[0], rel=0.02)  # the curve is fitted


@pytest.mark.parametrize(
    "text",
    [
        "a ** 2.0",
        "a % b",
        "a if b else c",
        "[a]",
        "lambda: a",
        "a.b",
        "a and b",
        "'a'",
        "2",
        "f(x=a)",
        "a +",
    ],
)
def test_what_numpy_and_c_do_not_have_in_common_is_refused(text) -> None:
    with pytest.raises(FormulaError):
        expression(text)


@pytest.mark.parametrize(
    "text", ["a * soc * soc", "soc * a", "soc + soc", "a", "soc / a", "soc + 1.0"]
)
def test_a_row_must_be_a_sum_of_coefficients_times_variables(text) -> None:
    with pytest.raises(FormulaError):
        terms_of(expression(text), ("soc",))


@pytest.mark.parametrize("text", ["soc + on", "soc > 0.0", "0.0 >= soc >= 1.0"])
def test_a_row_must_have_bounds(text) -> None:
    with pytest.raises(FormulaError):
        _ = Row("r", text).terms


def test_terms_keep_signs_and_order() -> None:
    row = Row("r", "low <= soc - 2.0 * on - (a + b) * soc_before <= high")
    assert [entry.name for entry in row.terms] == ["soc", "on", "soc_before"]
    values = [eval(code_of(f), {"a": 1.0, "b": 4.0}) for f in row.terms.values()]
    assert values == [1.0, -2.0, -5.0]
    assert not row.is_equality
    assert row.before == Entry(Var.SOC, True)


def test_rows_follow_each_other_with_their_pieces() -> None:
    rows = Rows(Table(True, True), fuel=5, battery=8)
    places = [i for row in ROWS for i in range(rows.count)[rows[row.name]]]
    assert places == list(range(rows.count))


def table() -> str:
    """The table of docs/qp.md."""
    lines = ["| row | holds for | equation |", "|---|---|---|"]
    for row in ROWS:
        lines.append(
            f"| `{row.name}` | {row.pieces and f'each {row.pieces} piece'} | `{row.text}` |"
        )
    return "\n".join(lines)


def test_docs_show_the_table() -> None:
    """Change docs/qp.md with the table: what stands there is what is solved."""
    text = DOCS.read_text("utf-8")
    assert table() in text
    assert LINES.strip() in text
    assert COST in text
