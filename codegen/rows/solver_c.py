"""C code of the algorithms from the table of rows: ADMM's and OSQP's work on a stage's rows."""

from functools import lru_cache

from qpmpc.codegen.rows.elimination import (
    Elimination,
    factor_type,
    factorise,
    substitute,
    weight,
)
from qpmpc.codegen.rows.stage_c import (
    Places,
    bounds,
    function,
    header,
    heat_h,
    is_unit,
    member,
    of_pieces,
    place,
    product,
    types_h,
    values_h,
    variable,
)
from qpmpc.qp.rows import Entry, Table

MATRIX = "const mpc_stage_matrix *const a = &stage->a;"


@lru_cache(maxsize=8)
def rows_files(table: Table, places: Places, algorithm: str, learning: bool) -> dict[str, str]:
    """Return the headers that are made from the table of rows, by name; not to be changed.

    Parameters
    ----------
    table : of the vehicle
    places : of the controller's parameters
    algorithm : `admm` or `osqp`
    learning : whether the fuel curve is in the state
    """
    files = {
        "mpc_heat.h": heat_h(places),
        "mpc_rows.h": types_h(table),
        "mpc_rows_values.h": values_h(table, places, learning),
    }
    if algorithm == "osqp":
        return files | {"mpc_rows_osqp.h": osqp_h(table)}
    e = Elimination.shortest(table)  # one order of pivots for all of the solver
    return files | {"mpc_rows_factor.h": factor_h(e), "mpc_rows_admm.h": admm_h(e)}


def factor_h(e: Elimination) -> str:
    """Return `mpc_rows_factor.h`: the type of a stage's factor."""
    what = "Factor of a stage."
    return header("mpc_rows_factor.h", what, ["mpc_rows.h"], factor_type(e))


def admm_h(e: Elimination) -> str:
    """Return `mpc_rows_admm.h`: the code of an iteration, row by row."""
    return header(
        "mpc_rows_admm.h",
        "An iteration of ADMM, row by row.",
        ["mpc_admm.h", "mpc_parts.h"],
        _multiply(e.table),
        factorise(e),
        _right_hand_side(e.table),
        substitute(e),
        _update_z_y(e.table),
    )


def osqp_h(table: Table) -> str:
    """Return `mpc_rows_osqp.h`: entries column by column, in OSQP's order, and bounds."""
    return header(
        "mpc_rows_osqp.h",
        "The rows in OSQP's order.",
        ["mpc_parts.h", "mpc_real.h"],
        "#define UNLIMITED REAL(1.0e30)\n",
        _put_columns(table),
        _put_bounds(table),
    )


def _multiply(table: Table) -> str:
    lines = [MATRIX]
    for row in table.rows:
        lines += of_pieces(row, [f"value[{place(row)}] = {product(row)};"])
    return function(
        "void rows_multiply(const mpc_stage *stage, const mpc_real *x, const mpc_real *before,\n"
        "                                 mpc_real *value)",
        "value = Ax",
        lines,
    )


def _right_hand_side(table: Table) -> str:
    lines = [MATRIX]
    for var in table.variables:
        start = f"(mpc_par.proximal * stage->x[{variable(var)}]) - stage->q[{variable(var)}]"
        lines.append(f"mpc_real {var.name.lower()} = {start};")
    for row in table.rows:
        at = place(row)
        name = "w" if row.pieces else f"w_{row.name}"
        weighted = f"({weight(row)} * stage->z[{at}]) - stage->y[{at}]"
        inside = [f"const mpc_real {name} = {weighted};"]
        for entry in row.terms:
            sum_ = f"work_before[{variable(entry.var)}]" if entry.before else entry.name
            inside.append(f"{sum_} += {'' if is_unit(row) else f'{member(row, entry)} * '}{name};")
        lines += of_pieces(row, inside)
    lines += [f"stage->work[{variable(var)}] = {var.name.lower()};" for var in table.variables]
    return function(
        "void rows_right_hand_side(mpc_stage *stage, mpc_real *work_before)",
        "work = s x - q + A'(Rz - y), with the rows' part for the previous stage",
        lines,
    )


def _update_z_y(table: Table) -> str:
    lines = [MATRIX, "const mpc_stage_bounds *const b = &stage->b;"]
    lines.append("const mpc_real *const x = stage->work;")
    for row in table.rows:
        low, high = bounds(row)
        at = f"&stage->z[{place(row)}], &stage->y[{place(row)}]"
        if row.is_equality:
            call = f"update_equality({product(row)}, {low}, {at});"
        elif high is None:
            call = f"update_above({product(row)}, {low}, {at});"
        elif low is None:
            call = f"update_below({product(row)}, {high}, {at});"
        else:
            call = f"update_between({product(row)}, {low}, {high}, {at});"
        lines += of_pieces(row, [call])
    return function(
        "void rows_update_z_y(mpc_stage *stage, const mpc_real *before)",
        "z and y of all rows from t, in `work`; `before` is that of the previous stage.",
        lines,
    )


def _put_columns(table: Table) -> str:
    lines = ["int32_t at = first;"]
    for var in table.variables:
        here, before = Entry(var, False), Entry(var, True)
        for row in table.rows:
            if here in row.terms:
                value = "REAL(1.0)" if is_unit(row) else member(row, here)
                lines += of_pieces(row, [f"values[at] = {value};", "at++;"])
        for row in table.rows:
            if before in row.terms:
                value = member(row, before, "next")
                lines += ["if (next != NULL) {", f"    values[at] = {value};", "    at++;", "}"]
    return function(
        "int32_t rows_put_columns(mpc_real *values, int32_t first, const mpc_stage_matrix *a,\n"
        "                                       const mpc_stage_matrix *next)",
        "Entries of a stage's columns, each from the first row down; returns the end.",
        [*lines, "return at;"],
    )


def _put_bounds(table: Table) -> str:
    lines = []
    for row in table.rows:
        low, high = bounds(row)
        both = [f"low[{place(row)}] = {low or '-UNLIMITED'};"]
        both.append(f"high[{place(row)}] = {high or 'UNLIMITED'};")
        lines += of_pieces(row, both)
    return function(
        "void rows_put_bounds(mpc_real *low, mpc_real *high, const mpc_stage_bounds *b)",
        "Bounds of a stage's rows.",
        lines,
    )
