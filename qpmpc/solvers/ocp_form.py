"""The form that solvers of optimal control problems need: nodes with states and controls.

Node k has the states x_k before stage k and the controls u_k; node n, after the last stage, has
those that remain:

    min  1/2 v'Pv + q'v   s.t.  x_{k+1} = F_k x_k + G_k u_k + c_k,
                                low_k <= C_k x_k + D_k u_k <= high_k,  bounds on v

with v = (u_0, x_1, u_1, ..., x_n, u_n): the states now are numbers within c_0. A variable of
stage k that shares a row with the states at its end, as a slack does, is a control of node k + 1.
A control that the next stage sees as well has a copy among the states.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from qpmpc.qp.rows import Table, Var
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats

Indices = NDArray[np.intp]
NONE = -1  # no such variable, or no such row


@dataclass(frozen=True)
class Roles:
    """What the variables and the rows of a stage are in an optimal control problem.

    Attributes
    ----------
    states, copies : given by the dynamics; controls that the next stage sees
    controls, late : of the node before the stage; of the node after it
    dynamics : names of the rows that give the states, in their order
    at_end : names of the rows of the node after the stage
    bounds : names of the rows of one variable, at most one for each
    """

    states: list[Var]
    copies: list[Var]
    controls: list[Var]
    late: list[Var]
    dynamics: list[str]
    at_end: set[str]
    bounds: set[str]

    @classmethod
    def of(cls, table: Table) -> "Roles":
        """Sort the variables and rows of a table."""
        states = table.states
        own = {row.name: [e.var for e in row.terms if not e.before] for row in table.rows}
        dynamics = {own[row.name][0]: row.name for row in table.rows if row.is_equality}
        paths = [row.name for row in table.rows if not row.is_equality]
        with_states = {v for name in paths if set(own[name]) & set(states) for v in own[name]}
        rates = [v for v in table.variables if v not in states]
        bounds: dict[Var, str] = {}
        for row in table.rows:
            if len(row.terms) == 1 and not row.pieces:
                bounds.setdefault(own[row.name][0], row.name)
        return cls(
            states=states,
            copies=[v for v in table.coupling if v not in states],
            controls=[v for v in rates if v not in with_states],
            late=[v for v in rates if v in with_states],
            dynamics=[dynamics[var] for var in states],
            at_end={name for name in paths if set(own[name]) <= with_states},
            bounds=set(bounds.values()),
        )


class OcpForm:
    """The QP reordered; each step only picks values out of the data vector of A.

    Parameters
    ----------
    structure : pattern of the QP

    Attributes
    ----------
    nx, nu, ng : states, controls and path rows of each node, (n + 1)
    is_dynamics : which rows are dynamics
    shape, indices, indptr : CSC pattern of all rows: of each node the dynamics, then the path
    """

    def __init__(self, structure: QpStructure) -> None:
        roles = Roles.of(structure.rows.table)
        n = structure.stages
        x, late, now = len(roles.states + roles.copies), len(roles.late), len(roles.controls)
        self.nx = [0] + [x] * n
        self.nu = [now] + [late + now] * (n - 1) + [late]
        self._size = n * (x + late + now)
        self._place, copy = _places(structure, roles)
        self._source, self.ng, copied = _row_order(structure, roles)
        each = [[True] * x + [False] * ng for ng in self.ng[:-1]] + [[False] * self.ng[-1]]
        self.is_dynamics = np.concatenate([np.array(mask, dtype=bool) for mask in each])
        self._real = np.flatnonzero(self._source != NONE)
        names = structure.rows.table.rows
        single = [structure.rows.first(row.name) for row in names if row.name in roles.bounds]
        self._bound_rows = np.add.outer(
            np.arange(n) * structure.rows.count, np.array(single, dtype=np.intp)
        ).ravel()

        self._copied, self._copies = copied, copy[copied]
        # of each entry of A, its position in A's data vector; two constants lie behind it
        count = structure.rows.count
        pattern = structure.positions().tocoo()
        new_row = np.full(structure.shape[0], NONE)
        new_row[self._source[self._real]] = self._real
        before = pattern.row // count != pattern.col // structure.variables
        column = np.where(before & (copy[pattern.col] != NONE), copy[pattern.col], 0)
        column = np.where(column > 0, column, self._place[pattern.col])
        kept = new_row[pattern.row] != NONE
        entries = structure.entries
        rows_of_copies = np.flatnonzero(self._source == NONE)
        matrix = sp.csc_matrix(
            (
                np.concatenate(
                    [
                        pattern.data[kept],
                        np.full(len(copied), entries + 1.0),
                        np.full(len(copied), entries + 2.0),
                    ]
                ),
                (
                    np.concatenate([new_row[pattern.row[kept]], rows_of_copies, rows_of_copies]),
                    np.concatenate([column[kept], self._place[copied], copy[copied]]),
                ),
            ),
            shape=(len(self._source), self._size),
        )
        matrix.sort_indices()
        self._from = (matrix.data - 1.0).astype(np.intp)
        self.shape, self.indices, self.indptr = matrix.shape, matrix.indices, matrix.indptr
        bounded = structure.positions().tocsr()[self._bound_rows]
        self._bound_from = (bounded.data - 1.0).astype(np.intp)
        self._bounded = self._place[bounded.indices]

    def values(self, data: QpData) -> Floats:
        """Non-zeros of all rows, in CSC order."""
        return np.asarray(np.append(data.a_data, [1.0, -1.0])[self._from])

    def row_bounds(self, data: QpData) -> tuple[Floats, Floats]:
        """Lower and upper bounds of all rows."""
        low, high = np.zeros(self.shape[0]), np.zeros(self.shape[0])
        low[self._real] = data.lower[self._source[self._real]]
        high[self._real] = data.upper[self._source[self._real]]
        return low, high

    def bounds(self, data: QpData) -> tuple[Floats, Floats]:
        """Lower and upper bounds of v."""
        factor = data.a_data[self._bound_from]
        first, second = data.lower[self._bound_rows] / factor, data.upper[self._bound_rows] / factor
        low, high = np.full(self._size, -np.inf), np.full(self._size, np.inf)
        low[self._bounded] = np.minimum(first, second)
        high[self._bounded] = np.maximum(first, second)
        return low, high

    def cost(self, data: QpData) -> tuple[Floats, Floats]:
        """Diagonal of P, and q."""
        p, q = np.zeros(self._size), np.zeros(self._size)
        p[self._place], q[self._place] = data.hessian, data.q
        return p, q

    def point(self, z: Floats) -> Floats:
        """Return v of the QP's variables z."""
        v = np.zeros(self._size)
        v[self._place] = z
        v[self._copies] = z[self._copied]
        return v

    def primal(self, v: Floats) -> Floats:
        """Return the QP's variables out of v."""
        return np.asarray(v[self._place])

    def dual(self, data: QpData, rows: Floats, bounds: Floats) -> Floats:
        """Return the QP's dual out of those of all rows and of the bounds on v."""
        y = np.zeros_like(data.lower)
        y[self._source[self._real]] = rows[self._real]
        y[self._bound_rows] = bounds[self._bounded] / data.a_data[self._bound_from]
        return y


def _places(structure: QpStructure, roles: Roles) -> tuple[Indices, Indices]:
    """Place in v of each variable of the QP, and of its copy or `NONE`."""
    at_end = [*roles.states, *roles.copies, *roles.late]
    each = len(at_end) + len(roles.controls)
    first = np.arange(structure.stages) * each  # of a stage's controls; then what is at its end
    index = {var: i for i, var in enumerate(structure.rows.table.variables)}
    place = np.full((structure.stages, structure.variables), NONE)
    copy = place.copy()
    for i, var in enumerate(roles.controls):
        place[:, index[var]] = first + i
    for i, var in enumerate(at_end):
        where = copy if var in roles.copies else place
        where[:, index[var]] = first + len(roles.controls) + i
    return place.ravel(), copy.ravel()


def _row_order(structure: QpStructure, roles: Roles) -> tuple[Indices, list[int], Indices]:
    """Row of A for each row, or `NONE` for that of a copy; path rows of a node; what is copied."""
    rows, table = structure.rows, structure.rows.table
    index = {var: i for i, var in enumerate(table.variables)}
    dynamics = [rows.first(name) for name in roles.dynamics]
    early: list[int] = []
    end: list[int] = []
    for row in table.rows:
        if not row.is_equality and row.name not in roles.bounds:
            place = rows[row.name]
            (end if row.name in roles.at_end else early).extend(range(place.start, place.stop))
    source: list[int] = []
    path_rows: list[int] = []
    copied: list[int] = []
    for k in range(structure.stages + 1):
        path = [(k - 1) * rows.count + i for i in end] if k > 0 else []
        if k < structure.stages:
            source += [k * rows.count + i for i in dynamics] + [NONE] * len(roles.copies)
            copied += [k * structure.variables + index[var] for var in roles.copies]
            path += [k * rows.count + i for i in early]
        source += path
        path_rows.append(len(path))
    return np.array(source, dtype=np.intp), path_rows, np.array(copied, dtype=np.intp)
