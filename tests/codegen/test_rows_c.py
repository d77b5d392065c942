"""C made from the table of rows: numbering, values, and a factor that leaves nothing out."""

import ctypes
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.generate import project_files
from qpmpc.codegen.host_library import compiled
from qpmpc.codegen.rows.c_text import Writer
from qpmpc.codegen.rows.elimination import Elimination
from qpmpc.codegen.rows.stage_c import FUNCTIONS, types_h, values_h
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.expressions import FormulaError, code_of, expression
from qpmpc.qp.rows import Entry, Row, Rows, Table, Var
from qpmpc.qp.structure import QpStructure
from qpmpc.vehicle import load_vehicle

FUEL, BATTERY = 3, 4
TABLES = [Table(), Table(True, False), Table(False, True), Table(True, True)]


def values():
    chosen = ControllerSettings()
    return values_of(load_vehicle(), chosen.mh_qp, chosen.rule_based)


def numbers(text: str) -> dict[str, int]:
    """Enumerators of C's header, with counts of pieces put in."""
    found: dict[str, int] = {"MPC_FUEL_PIECES": FUEL, "MPC_BATTERY_PIECES": BATTERY}
    for name, value in re.findall(r"^    (\w+) = ([^,/\n]+)", text, re.MULTILINE):
        found[name] = eval(value, {}, found)
    return found


@pytest.mark.parametrize("table", TABLES)
def test_python_and_c_number_variables_rows_and_entries_alike(table) -> None:
    found, rows = numbers(types_h(table)), Rows(table, fuel=FUEL, battery=BATTERY)
    variables = {f"MPC_VAR_{var.name}": var.value for var in table.variables}
    assert {name: found[name] for name in found if name.startswith("MPC_VAR_")} == variables
    places = {f"MPC_ROW_{row.name.upper()}": rows.first(row.name) for row in table.rows}
    assert {name: found[name] for name in found if name.startswith("MPC_ROW_")} == places
    assert (found["MPC_VARS"], found["MPC_ROWS"]) == (len(variables), rows.count)
    structure = QpStructure(3, rows)
    assert found["MPC_ENTRIES"] == len(structure.index)
    assert found["MPC_ENTRIES_BEFORE"] == structure.entry_before.sum()


def random_formula(rng: np.random.Generator, depth: int) -> str:
    if depth == 0:
        return str(rng.choice(["a", "b", "c", "2.0", "0.5"]))
    one, two, three = (
        random_formula(rng, depth - 1 - int(rng.integers(2)) * (depth > 1)) for _ in range(3)
    )
    kind = rng.integers(4)
    if kind == 0:
        return f"-({one})"
    if kind == 1:
        return f"{rng.choice(['min', 'max'])}({one}, {two})"
    if kind == 2:
        return f"where({one} > {two}, {three}, {one})"
    return f"({one}) {rng.choice(list('+-*/'))} ({two})"


@pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
def test_c_has_the_value_of_the_formula_to_the_last_bit() -> None:
    """Random formulas, compiled: parentheses, choices and literals lose nothing."""
    rng = np.random.default_rng(5)
    texts = [random_formula(rng, int(rng.integers(1, 5))) for _ in range(400)]
    writer = Writer({name: f"x[{i}]" for i, name in enumerate("abc")}, FUNCTIONS)
    lines = [f"y[{i}] = {writer.expression(expression(text))};" for i, text in enumerate(texts)]
    project = project_files(values(), "host", "f64")
    files = {name: project[name] for name in ("mpc_config.h", "mpc_arithmetic.h", "mpc_real.h")}
    body = "\n".join(lines)
    files["formulas.c"] = (
        f'#include "mpc_real.h"\nvoid evaluate(const mpc_real *x, mpc_real *y)\n{{\n{body}\n}}\n'
    )
    library = ctypes.CDLL(str(compiled(files)))
    for x in rng.uniform(0.1, 10.0, (20, 3)):
        found = np.empty(len(texts))
        library.evaluate(x.ctypes.data_as(ctypes.c_void_p), found.ctypes.data_as(ctypes.c_void_p))
        names = {"min": np.minimum, "max": np.maximum, "where": np.where}
        names |= dict(zip("abc", x, strict=True))
        with np.errstate(all="ignore"):
            expected = [float(eval(code_of(expression(text)), names)) for text in texts]
        np.testing.assert_array_equal(found, expected)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), stages=st.integers(1, 4), table=st.sampled_from(TABLES))
def test_the_factor_has_every_entry_that_elimination_makes(seed, stages, table) -> None:
    """Dense Cholesky of A'A + I with random entries, in the order of elimination."""
    rows, variables = Rows(table, fuel=FUEL, battery=BATTERY), len(table.variables)
    structure, e = QpStructure(stages, rows), Elimination.shortest(table)
    rng = np.random.default_rng(seed)
    a = structure.matrix_of(structure.data(rng.uniform(0.5, 1.5, (stages, len(structure.index)))))
    own = [entry.var for entry in e.own()]
    order = np.add.outer(np.arange(stages) * variables, own).ravel()
    normal = (a.T @ a).toarray()[np.ix_(order, order)] + np.eye(len(order))
    factor = np.abs(np.linalg.cholesky(normal)) > 1e-9
    expected = np.eye(len(order), dtype=bool)
    for k in range(stages):
        for before in (True, False) if k else (False,):
            for row, column in e.factors(before):
                i, j = own.index(row.var), own.index(column.var)
                expected[k * variables + i, (k - before) * variables + j] = True
    assert not (factor & ~expected).any()
    assert expected.sum() - factor.sum() <= variables  # nothing but fill of the first stage more


def test_a_new_variable_and_row_need_no_edit_of_the_factor() -> None:
    """A row more, with entries that no other has: its place in the factor is found."""
    row = Row("extra", "internal + soc_before - 2.0 * t_slack <= 5.0")
    table = Table()
    table.__dict__["rows"] = (*table.rows, row)
    e = Elimination(table, table.coupling)
    slack, internal = Entry(Var.T_SLACK, False), Entry(Var.INTERNAL, False)
    assert e.pair(slack, internal) in {e.pair(*pair) for pair in e.factors(before=False)}
    assert (slack, Entry(Var.SOC, True)) in e.factors(before=True)
    assert [entry.var for entry in e.own()][-2:] == [Var.SOC, Var.T_CL]


def test_names_and_constructs_that_c_does_not_have_are_refused() -> None:
    writer = Writer({"a": "a"}, FUNCTIONS)
    for text in ("b", "sin(a)", "a == a", "where(a, a)"):
        with pytest.raises(FormulaError):
            writer.expression(expression(text))
    with pytest.raises(FormulaError):
        values_h(
            Table(), (("t_amb_degc", "mpc_par.t_amb_degc"),), False
        )  # the other parameters are unknown
