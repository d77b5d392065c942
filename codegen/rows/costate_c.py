"""C code of the costate method from the table's quantities: types, and the numbers of a stage."""

import ast
from collections.abc import Iterable
from functools import lru_cache

from qpmpc.codegen.rows.c_text import ArithmeticWriter
from qpmpc.codegen.rows.stage_c import (
    FUNCTIONS,
    Places,
    function,
    header,
    heat_h,
    indented,
    names_of_values,
    road_types,
    struct,
    variable,
    with_heat,
)
from qpmpc.costate.program import MADE, PROGRAM, TAKEN
from qpmpc.qp import rows
from qpmpc.qp.expressions import names_in, parsed, targets_of
from qpmpc.qp.rows import Table

MULTIPLIERS = ("CHARGE", "HEAT")
OF_FUEL = ("fuel_cost", "per_fuel")
OF_START = "start_k"  # a number that is there only where starts cost something


@lru_cache(maxsize=8)
def costate_files(table: Table, places: Places) -> dict[str, str]:
    """Return the headers that are made from the table, by name; not to be changed."""
    return {
        "mpc_heat.h": heat_h(places, ArithmeticWriter),
        "mpc_rows.h": _types(table),
        "mpc_costate_values.h": _values(table, places),
    }


def _members(table: Table) -> list[str]:
    return [name for name in (*TAKEN, *MADE) if table.has_start or name != OF_START]


def _types(table: Table) -> str:
    variables = [f"{variable(var)} = {var.value}," for var in table.variables]
    variables.append(f"MPC_VARS = {len(table.variables)}")
    places = [f"MPC_ROW_{name} = {place}," for place, name in enumerate(MULTIPLIERS)]
    places.append(f"MPC_ROWS = {len(MULTIPLIERS)}")
    return header(
        "mpc_rows.h",
        "Variables, limits and numbers of a stage.",
        ["mpc_config.h"],
        f"/* Variables of a stage. */\nenum {{\n{indented(variables)}}};\n",
        f"/* Limits of a stage that have multipliers. */\nenum {{\n{indented(places)}}};\n",
        *road_types(),
        struct("Numbers of a stage.", "mpc_stage_program", _members(table)),
    )


def _needed(wanted: Iterable[str]) -> list[ast.stmt]:
    """Return the lines of the table's quantities that lead to these names."""
    names, kept = set(wanted), []
    for line in reversed(parsed(rows.QUANTITIES)):
        if names.intersection(targets_of(line)):
            kept.append(line)
            names.update(names_in(line))
    return kept[::-1]


def _scaled(name: str, value: str) -> str:
    """Return a number of a stage; what fuel costs and what heat it gives with its factor."""
    return f"cal->fuel_scale * {value}" if name in OF_FUEL else value


def _values(table: Table, places: Places) -> str:
    members = _members(table)
    own = [line for line in parsed(PROGRAM) if targets_of(line)[0] in members]
    wanted = {name for line in own for name in names_in(line)} | set(TAKEN)
    writer = with_heat(ArithmeticWriter(names_of_values(places), FUNCTIONS), places)
    needed = _needed(wanted)
    lines = writer.lines(needed)
    if any("is_last" in names_in(line) for line in needed):
        last = "const mpc_real is_last = (k == (MPC_STAGES - 1)) ? REAL(1.0) : REAL(0.0);"
        lines.insert(0, last)
    lines += [f"of->{name} = {_scaled(name, writer.names[name])};" for name in TAKEN]
    for line in own:
        (target,) = targets_of(line)
        assert isinstance(line, ast.Assign)
        lines.append(f"of->{target} = {_scaled(target, writer.inner(line.value))};")
        writer.names[target] = f"of->{target}"
    return header(
        "mpc_costate_values.h",
        "Numbers of a stage's program.",
        ["mpc_constants.h", "mpc_heat.h", "mpc_model.h", "mpc_parts.h", "mpc_real.h"],
        function(
            "void costate_fill(mpc_state *state, const mpc_calibration *cal, int32_t k, "
            "mpc_stage_sums *sums)",
            "Numbers of stage k. The first stage starts at the origin.",
            [
                "const mpc_stage_road *const road = &state->stage[k].road;",
                "mpc_stage_program *const of = &state->stage[k].p.of;",
                *lines,
            ],
        ),
    )
