"""The QP as the generated C makes and solves it, read back as plain matrices."""

import ctypes
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.controller import InputBuilder
from qpmpc.codegen.generate import project_files
from qpmpc.codegen.host_library import HostLibrary, compiled
from qpmpc.codegen.values import Values
from qpmpc.qp.rows import Var
from qpmpc.trip import Observation
from qpmpc.verification.renderings.matrices import Matrices, matrices_from

Floats = NDArray[np.float64]

READ = ("mpc_admm.c", "mpc_step.c")
UNBOUNDED = 1e29  # in solver units; the C code uses 1e30
SLICE, SLICES = 10_000, 300  # iterations between two checks of the residuals, and the most checks
GAP = 100.0  # the gap falls later than the error in the cost, to which it is an upper bound


class GeneratedQp:
    """The QP of one trip in the generated C, in double precision.

    The library is that of this machine with a reader beside it, which calls the solver itself.

    Parameters
    ----------
    values : numbers of the controller
    inputs : fills the input of a step

    Raises
    ------
    CodegenError
        If it cannot be built.
    """

    def __init__(self, values: Values, inputs: InputBuilder) -> None:
        project = project_files(values, "host", "f64")
        folder = files("qpmpc.verification.renderings").joinpath("read_c")
        for name in READ:  # appended, as it needs static functions of the files
            project[name] += folder.joinpath(f"append_to_{name}").read_text("utf-8")
        file = compiled(project)
        self.library = HostLibrary(file, values, "f64")
        self._reader = self.library.functions
        self._reader.reader_prepare.restype = ctypes.c_double
        self.inputs = inputs
        self._state = ctypes.create_string_buffer(self.library.state_bytes)
        self._in = self.library.input_type()
        self._columns = values.sizes.stages, values.variables
        self._rows = values.sizes.stages, values.rows.count

    def update(self, seen: Observation, x: Floats) -> Matrices:
        """Make the QP of an observation, expanded about a plan.

        Parameters
        ----------
        seen : step and state
        x : plan in SI units, shape (stages, variables)

        Returns
        -------
        cost and rows, in grams and SI units
        """
        self.inputs.fill(seen, self._in)
        plan = np.array(x, dtype=float)
        cost = self._reader.reader_prepare(self._state, ctypes.byref(self._in), _pointer(plan))
        (stages, rows), variables = self._rows, self._columns[1]
        here, before = self._read("reader_matrix", *[(stages, rows, variables)] * 2)
        a = np.zeros((stages, rows, stages, variables))
        for k in range(stages):
            a[k, :, k] = here[k]
            if k:
                a[k, :, k - 1] = before[k]
        low, high, row = map(np.ravel, self._read("reader_rows", *[self._rows] * 3))
        gradient, hessian, column = map(
            np.ravel, self._read("reader_columns", *[self._columns] * 3)
        )
        origin = np.zeros(self._columns)  # the C code counts the states from here
        origin[:, Var.SOC], origin[:, Var.T_CL] = seen.soc, seen.t_cl_degc
        self._a = a.reshape(len(row), len(column)) / row[:, None] / column
        shift = self._a @ origin.ravel()
        self._lower = np.where(low > -UNBOUNDED, low, -np.inf) / row + shift
        self._upper = np.where(high < UNBOUNDED, high, np.inf) / row + shift
        self._curvature = hessian / column**2 / cost
        self._gradient = gradient / column / cost - self._curvature * origin.ravel()
        self._row, self._column = row, column
        return matrices_from(self._a, self._lower, self._upper, self._curvature, self._gradient)

    def solve(self, tolerance: float) -> Floats:
        """Iterate on the QP of the last update until its KKT residuals are within a tolerance.

        Parameters
        ----------
        tolerance : on the violation of rows, in solver units, and on the gradient of the
            Lagrangian relative to the cost; on the duality gap GAP times that

        Returns
        -------
        x in SI units, shape (stages * variables,)
        """
        for _ in range(SLICES):
            self._reader.mpc_solver_iterate(self._state, SLICE)
            x, dual = np.empty(self._columns), np.empty(self._rows)
            self.library.plan(self._state, _pointer(x), _pointer(dual))
            if self._residual(x.ravel(), dual.ravel()) < tolerance:
                break
        return x.ravel()

    def _residual(self, x: Floats, dual: Floats) -> float:
        product = self._a @ x
        off = (np.maximum(product - self._upper, self._lower - product) * self._row).max()
        above = np.maximum(dual, 0.0) @ np.where(np.isfinite(self._upper), self._upper, 0.0)
        below = np.maximum(-dual, 0.0) @ np.where(np.isfinite(self._lower), self._lower, 0.0)
        curved = self._curvature * x
        size = 1.0 + abs(float(self._gradient @ x))
        gap = abs(float(x @ (curved + self._gradient) + above - below)) / size
        slope = np.abs((curved + self._gradient + self._a.T @ dual) * self._column).max() / size
        return max(float(off), gap / GAP, float(slope))

    def _read(self, function: str, *shapes: tuple[int, ...]) -> list[Floats]:
        parts = [np.empty(shape) for shape in shapes]
        getattr(self._reader, function)(self._state, *map(_pointer, parts))
        return parts


def _pointer(array: Floats) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
