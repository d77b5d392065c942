"""C code that factorises the normal matrix P + s I + A'RA stage by stage.

Which entries the factor has is found here, by symbolic elimination on the pattern of the table of
rows: a new variable or entry needs no edit.
"""

from collections.abc import Iterable, Iterator
from itertools import combinations_with_replacement, permutations

from qpmpc.codegen.rows_c import function, indented, is_unit, member, of_pieces, variable
from qpmpc.qp.rows import ROWS, Entry, Row, Var, states

STATES = states()


def local(var: Var) -> str:
    """Return the name of a variable in C."""
    return var.name.lower()


def weight(row: Row) -> str:
    """Return rho of a row in C."""
    return "mpc_par.rho_equality" if row.is_equality else "mpc_par.rho"


class Elimination:
    """Columns of the factor L D L' of a stage.

    First those of the states before, then the stage's own variables: next whatever leaves the
    fewest entries, the states last, because the next stage needs them.

    Attributes
    ----------
    order : variables of a stage, as they are eliminated
    before : by state before, the variables of the stage in its column
    own : by variable, those eliminated later in its column
    """

    def __init__(self) -> None:
        edges: dict[Var, set[Var]] = {var: set() for var in Var}

        def connect(members: Iterable[Var]) -> None:
            for one, other in permutations(members, 2):
                edges[one].add(other)

        here = {row.name: [entry.var for entry in row.terms if not entry.before] for row in ROWS}
        for members in here.values():
            connect(members)
        connect(STATES)  # by rows of the stage after, or by elimination
        self.before: dict[Var, list[Var]] = {}
        column: set[Var] = set()
        for state in STATES:  # a later state's column takes over what an earlier one's has
            column |= {v for row in ROWS if Entry(state, True) in row.terms for v in here[row.name]}
            self.before[state] = list(column)
            connect(column)
        self.order: list[Var] = []
        self.own: dict[Var, list[Var]] = {}
        while edges:
            inner = [var for var in reversed(Var) if var in edges and var not in STATES]
            last = [var for var in STATES if var in edges]
            pivot = min(inner, key=lambda var: len(edges[var])) if inner else last[0]
            self.order.append(pivot)
            self.own[pivot] = list(edges.pop(pivot))
            for var in self.own[pivot]:
                edges[var].discard(pivot)
            connect(self.own[pivot])
        for found in (*self.before.values(), *self.own.values()):
            found.sort(key=self.order.index)

    def pair(self, one: Var, other: Var) -> tuple[Var, Var]:
        """Return a pair with the one that is eliminated later first."""
        return (one, other) if self.order.index(one) >= self.order.index(other) else (other, one)

    def normal(self, one: Var, other: Var) -> str:
        """Return the name of an entry of the normal matrix."""
        later, earlier = self.pair(one, other)
        return f"m_{local(later)}_{local(earlier)}"

    def pairs(self) -> list[tuple[Var, Var]]:
        """Entries of the normal matrix, fill-in too."""
        columns = [*self.before.values(), *([p, *column] for p, column in self.own.items())]
        both = [self.pair(a, b) for c in columns for a, b in combinations_with_replacement(c, 2)]
        return list(dict.fromkeys(both))


def factor_type(e: Elimination) -> str:
    """Return the type of a stage's factor."""
    names = [f"{local(v)}_{local(s)}_before" for s, column in e.before.items() for v in column]
    names += [f"{local(v)}_{local(p)}" for p, column in e.own.items() for v in column]
    lines = [f"real_t {name};" for name in (*names, "inverse_d[MPC_VARS]")]
    return (
        "/* L D L' of a stage: what of L can differ from 0, as row_column; the columns of the\n"
        " * states before too. */\n"
        f"typedef struct {{\n{indented(lines)}}} stage_factor;\n"
    )


def factorise(e: Elimination) -> str:
    """Return the function that assembles and factorises a stage."""
    lines = ["const stage_matrix *const a = &stage->a;", "stage_factor *const f = &stage->factor;"]
    lines += [f"real_t {e.normal(*pair)} = REAL(0.0);" for pair in e.pairs()]
    lines += _assemble(e)
    lines += ["if (after != NULL) {", "    const stage_matrix *const next = &after->a;"]
    for row in ROWS:
        for one, other in _pairs(row, before=True):
            values = f"{member(row, one, 'next')} * {member(row, other, 'next')}"
            lines.append(f"    {e.normal(one.var, other.var)} += {weight(row)} * {values};")
    lines += ["}", "if (before != NULL) {", "    const stage_factor *const g = &before->factor;"]
    lines += [f"    {line}" for line in _eliminate_before(e)]
    lines.append("}")
    for pivot, column in e.own.items():
        inverse = f"f->inverse_d[{variable(pivot)}]"
        lines.append(f"{inverse} = REAL(1.0) / {e.normal(pivot, pivot)};")
        factor = {var: f"f->{local(var)}_{local(pivot)}" for var in column}
        lines += [f"{factor[var]} = {e.normal(var, pivot)} * {inverse};" for var in column]
        for low, high in combinations_with_replacement(column, 2):
            lines.append(f"{e.normal(low, high)} -= {factor[high]} * {e.normal(low, pivot)};")
    return function(
        "void rows_factorise(mpc_stage *stage, const mpc_stage *before, const mpc_stage *after)",
        "P + s I + A'RA of a stage, factorised once the stage before is.",
        lines,
    )


def _pairs(row: Row, before: bool) -> Iterator[tuple[Entry, Entry]]:
    entries = [entry for entry in row.terms if entry.before is before]
    yield from combinations_with_replacement(entries, 2)


def _assemble(e: Elimination) -> list[str]:
    """Inequalities first, to be weighted all at once; then Hessian and equalities."""
    lines, touched = [], set()
    for row in ROWS:
        if not row.is_equality:
            products = []
            for one, other in _pairs(row, before=False):
                touched.add(e.pair(one.var, other.var))
                value = f"{member(row, one)} * {member(row, other)}"
                value = "REAL(1.0)" if is_unit(row) else value
                products.append(f"{e.normal(one.var, other.var)} += {value};")
            lines += of_pieces(row, products)
    for later, earlier in e.pairs():
        name = e.normal(later, earlier)
        if later is earlier:
            small = f"stage->hessian[{variable(later)}] + mpc_par.proximal"
            lines.append(f"{name} = {small} + (mpc_par.rho * {name});")
        elif (later, earlier) in touched:
            lines.append(f"{name} *= mpc_par.rho;")
    for row in ROWS:
        if row.is_equality:
            for one, other in _pairs(row, before=False):
                values = f"{member(row, one)} * {member(row, other)}"
                lines.append(f"{e.normal(one.var, other.var)} += {weight(row)} * {values};")
    return lines


def _eliminate_before(e: Elimination) -> list[str]:
    """Columns c of the states before in A'RA, and what their elimination leaves."""
    lines = []
    for state, column in e.before.items():
        known = [row for row in ROWS if Entry(state, True) in row.terms]
        for var in column:
            terms = [
                f"({weight(row)} * {member(row, Entry(state, True))} * {member(row, entry)})"
                for row in known
                if (entry := Entry(var, False)) in row.terms
            ]
            start = " + ".join(terms) or "REAL(0.0)"
            lines.append(f"real_t c_{local(var)}_{local(state)} = {start};")
    for state, column in e.before.items():
        c = {var: f"c_{local(var)}_{local(state)}" for var in column}
        factor = {var: f"f->{local(var)}_{local(state)}_before" for var in column}
        lines += [f"{factor[var]} = {c[var]} * g->inverse_d[{variable(state)}];" for var in column]
        for one, other in combinations_with_replacement(column, 2):
            lines.append(f"{e.normal(one, other)} -= {factor[other]} * {c[one]};")
        for later in e.own[state]:
            held = f"g->{local(later)}_{local(state)}"
            lines += [f"c_{local(var)}_{local(later)} -= {c[var]} * {held};" for var in column]
    return lines


def substitute(e: Elimination) -> str:
    """Return the two halves of a solution with the factor."""
    start = ["const stage_factor *const f = &stage->factor;", "real_t *const work = stage->work;"]
    load = [f"real_t {local(var)} = work[{variable(var)}];" for var in e.order]
    store = [f"work[{variable(var)}] = {local(var)};" for var in e.order]
    coupled = [(state, var) for state, column in e.before.items() for var in column]
    inside = [(pivot, var) for pivot, column in e.own.items() for var in column]
    forward = [
        *start,
        *load,
        "if (before != NULL) {",
        *(
            f"    {local(v)} -= f->{local(v)}_{local(s)}_before * before->work[{variable(s)}];"
            for s, v in coupled
        ),
        "}",
        *(f"{local(v)} -= f->{local(v)}_{local(p)} * {local(p)};" for p, v in inside),
        *store,
    ]
    scale = [
        line.replace(";", f" * f->inverse_d[{variable(v)}];")
        for line, v in zip(load, e.order, strict=True)
    ]
    backward = [
        *start,
        *scale,
        "if (after != NULL) {",
        "    const stage_factor *const g = &after->factor;",
        *(
            f"    {local(s)} -= g->{local(v)}_{local(s)}_before * after->work[{variable(v)}];"
            for s, v in coupled
        ),
        "}",
        *(f"{local(p)} -= f->{local(v)}_{local(p)} * {local(v)};" for p, v in reversed(inside)),
        *store,
    ]
    return "\n".join(
        [
            function(
                "void rows_substitute_forward(mpc_stage *stage, const mpc_stage *before)",
                "work <- L^-1 work, once the stage before is done",
                forward,
            ),
            function(
                "void rows_substitute_backward(mpc_stage *stage, const mpc_stage *after)",
                "work <- L^-T D^-1 work, once the stage after is done",
                backward,
            ),
        ]
    )
