"""C code that factorises the normal matrix P + s I + A'RA stage by stage.

The entries of the factor are found here, by symbolic elimination on the pattern of the table of
rows: a new variable or entry needs no edit.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations_with_replacement, permutations
from typing import Self

from qpmpc.codegen.rows.stage_c import function, is_unit, member, of_pieces, struct, variable
from qpmpc.qp.rows import Entry, Row, Table, Var


def weight(row: Row) -> str:
    """Return rho of a row in C."""
    return "mpc_par.rho_equality" if row.is_equality else "mpc_par.rho"


class Elimination:
    """The factor L D L' of a stage, column by column.

    First those variables of the previous stage that rows of this one contain, whose elimination
    that stage has prepared, then the stage's own variables: next the one that leaves the fewest
    entries, those that the next stage needs last.

    Parameters
    ----------
    table : rows
    coupling : the variables that couple stages, in the order of their elimination

    Attributes
    ----------
    columns : by pivot, the entries below it, in the order of elimination
    """

    def __init__(self, table: Table, coupling: Sequence[Var]) -> None:
        self.table = table
        edges: dict[Entry, set[Entry]] = {
            Entry(var, False): set() for var in reversed(table.variables)
        }
        before = [Entry(var, True) for var in coupling]
        ends = [Entry(var, False) for var in coupling]
        edges |= {entry: set() for entry in before}

        def connect(members: Iterable[Entry]) -> None:
            for one, other in permutations(members, 2):
                edges[one].add(other)

        for row in table.rows:
            connect(row.terms)
        connect(before)  # by the elimination of the previous stage
        connect(ends)  # by rows of the next stage
        found: dict[Entry, list[Entry]] = {}
        while edges:
            first = [entry for entry in before if entry in edges]
            inner = [entry for entry in edges if entry not in ends]
            last = [entry for entry in ends if entry in edges]
            pivot = [*first, *sorted(inner, key=lambda entry: len(edges[entry])), *last][0]
            found[pivot] = list(edges.pop(pivot))
            connect(found[pivot])
            for entry in found[pivot]:
                edges[entry].discard(pivot)
        self._rank = {entry: i for i, entry in enumerate(found)}
        self.columns = {
            p: sorted(column, key=self._rank.__getitem__) for p, column in found.items()
        }

    @classmethod
    def shortest(cls, table: Table) -> Self:
        """Return that with the fewest entries over all orders of the coupling variables."""
        orders = permutations(table.coupling)
        return min((cls(table, order) for order in orders), key=lambda e: e.count)

    @property
    def count(self) -> int:
        """Entries of a stage's factor."""
        return sum(len(list(self.factors(before))) for before in (True, False))

    def pair(self, one: Entry, other: Entry) -> tuple[Entry, Entry]:
        """Return a pair, the one eliminated later first."""
        return (one, other) if self._rank[one] >= self._rank[other] else (other, one)

    def normal(self, one: Entry, other: Entry) -> str:
        """Return the name of an entry of the normal matrix."""
        return "m_{}_{}".format(*(entry.name for entry in self.pair(one, other)))

    def pairs(self) -> list[tuple[Entry, Entry]]:
        """Entries of the normal matrix with fill-in, except those between previous states."""
        return list(
            dict.fromkeys(
                self.pair(one, other)
                for pivot, column in self.columns.items()
                for one, other in combinations_with_replacement([pivot, *column], 2)
                if not (one.before and other.before)
            )
        )

    def factors(self, before: bool) -> Iterator[tuple[Entry, Entry]]:
        """Entries of L of a stage as (row, column), in previous columns or its own."""
        for pivot, column in self.columns.items():
            if pivot.before is before:
                yield from ((entry, pivot) for entry in column if not entry.before)

    def own(self) -> list[Entry]:
        """Variables of the stage, in the order of elimination."""
        return [entry for entry in self.columns if not entry.before]


def factor_of(row: Entry, column: Entry) -> str:
    """Return an entry of L in C; between previous states it is the previous stage's."""
    if row.before:
        return f"g->{Entry(row.var, False).name}_{Entry(column.var, False).name}"
    return f"f->{row.name}_{column.name}"


def factor_type(e: Elimination) -> str:
    """Return the type of a stage's factor."""
    names = [factor_of(*pair)[3:] for before in (True, False) for pair in e.factors(before)]
    comment = "L D L' of a stage: row_column of L where it can differ from 0, previous states too."
    return struct(comment, "mpc_stage_factor", (*names, "inverse_d[MPC_VARS]"))


def factorise(e: Elimination) -> str:
    """Return the function that assembles and factorises a stage."""
    lines = [
        "const mpc_stage_matrix *const a = &stage->a;",
        "mpc_stage_factor *const f = &stage->factor;",
    ]
    lines += [f"mpc_real {e.normal(*pair)} = REAL(0.0);" for pair in e.pairs()]
    lines += _assemble(e)
    lines += ["if (after != NULL) {", "    const mpc_stage_matrix *const next = &after->a;"]
    for row in e.table.rows:
        known = [entry for entry in row.terms if entry.before]
        for one, other in combinations_with_replacement(known, 2):
            name = e.normal(Entry(one.var, False), Entry(other.var, False))
            values = f"{member(row, one, 'next')} * {member(row, other, 'next')}"
            lines.append(f"    {name} += {weight(row)} * {values};")
    lines += [
        "}",
        "if (before != NULL) {",
        "    const mpc_stage_factor *const g = &before->factor;",
    ]
    pivots = {pivot: _eliminate(e, pivot, column) for pivot, column in e.columns.items()}
    lines += [f"    {line}" for pivot, part in pivots.items() if pivot.before for line in part]
    lines += ["}", *(line for pivot, part in pivots.items() if not pivot.before for line in part)]
    return function(
        "void rows_factorise(mpc_stage *stage, const mpc_stage *before, const mpc_stage *after)",
        "P + s I + A'RA of a stage, factorised after the previous stage.",
        lines,
    )


def _assemble(e: Elimination) -> list[str]:
    """Inequalities first, weighted together; then Hessian and equalities."""
    inequalities: list[str] = []
    equalities: list[str] = []
    touched = set()
    for row in e.table.rows:
        products = []
        for one, other in combinations_with_replacement(row.terms, 2):
            if not (one.before and other.before):
                value = f"{member(row, one)} * {member(row, other)}"
                value = "REAL(1.0)" if is_unit(row) else value
                value = f"{weight(row)} * {value}" if row.is_equality else value
                products.append(f"{e.normal(one, other)} += {value};")
                if not row.is_equality:
                    touched.add(e.pair(one, other))
        (equalities if row.is_equality else inequalities).extend(of_pieces(row, products))
    weighted = []
    for later, earlier in e.pairs():
        name = e.normal(later, earlier)
        if later == earlier:
            small = f"stage->hessian[{variable(later.var)}] + mpc_par.proximal"
            weighted.append(f"{name} = {small} + (mpc_par.rho * {name});")
        elif (later, earlier) in touched:
            weighted.append(f"{name} *= mpc_par.rho;")
    return inequalities + weighted + equalities


def _eliminate(e: Elimination, pivot: Entry, column: list[Entry]) -> list[str]:
    place = f"inverse_d[{variable(pivot.var)}]"
    inverse = f"g->{place}" if pivot.before else f"f->{place}"
    lines = [] if pivot.before else [f"{inverse} = REAL(1.0) / {e.normal(pivot, pivot)};"]
    for entry in column:
        if not entry.before:
            lines.append(f"{factor_of(entry, pivot)} = {e.normal(entry, pivot)} * {inverse};")
    for low, high in combinations_with_replacement(column, 2):
        if low.before and not high.before:  # the pivot's share of it was eliminated before
            value = f"{factor_of(low, pivot)} * {e.normal(high, pivot)}"
            lines.append(f"{e.normal(high, low)} -= {value};")
        elif not low.before:
            value = f"{factor_of(high, pivot)} * {e.normal(low, pivot)}"
            lines.append(f"{e.normal(high, low)} -= {value};")
    return lines


def substitute(e: Elimination) -> str:
    """Return the two halves of a solution with the factor."""
    start = [
        "const mpc_stage_factor *const f = &stage->factor;",
        "mpc_real *const work = stage->work;",
    ]
    load = [f"mpc_real {entry.name} = work[{variable(entry.var)}]" for entry in e.own()]
    inverse = [f"f->inverse_d[{variable(entry.var)}]" for entry in e.own()]
    store = [f"work[{variable(entry.var)}] = {entry.name};" for entry in e.own()]
    forward = [
        *start,
        *(f"{line};" for line in load),
        "if (before != NULL) {",
        *(
            f"    {row.name} -= {factor_of(row, state)} * before->work[{variable(state.var)}];"
            for row, state in e.factors(before=True)
        ),
        "}",
        *(f"{row.name} -= {factor_of(row, p)} * {p.name};" for row, p in e.factors(before=False)),
        *store,
    ]
    backward = [
        *start,
        *(f"{line} * {scale};" for line, scale in zip(load, inverse, strict=True)),
        "if (after != NULL) {",
        "    const mpc_stage_factor *const next = &after->factor;",
        *(
            f"    {Entry(state.var, False).name} -= "
            f"next->{factor_of(row, state)[3:]} * after->work[{variable(row.var)}];"
            for row, state in e.factors(before=True)
        ),
        "}",
        *(
            f"{p.name} -= {factor_of(row, p)} * {row.name};"
            for row, p in reversed(list(e.factors(before=False)))
        ),
        *store,
    ]
    return "\n".join(
        [
            function(
                "void rows_substitute_forward(mpc_stage *stage, const mpc_stage *before)",
                "work <- L^-1 work, after the previous stage",
                forward,
            ),
            function(
                "void rows_substitute_backward(mpc_stage *stage, const mpc_stage *after)",
                "work <- L^-T D^-1 work, after the next stage",
                backward,
            ),
        ]
    )
