"""A QP plugin of CasADi, called without copies through buffers."""

from types import ModuleType
from typing import Any

import numpy as np

from qpmpc.errors import InputError
from qpmpc.solvers.base import Floats

IN = ("h", "g", "a", "lba", "uba", "lbx", "ubx", "x0", "lam_x0", "lam_a0")
OUT = ("x", "lam_a", "lam_x")


def check_plugin(casadi: ModuleType, plugin: str) -> None:
    """Check that the installed CasADi has a plugin.

    Raises
    ------
    InputError
        If it has not.
    """
    if not casadi.has_conic(plugin):
        raise InputError(
            f"solver {plugin!r} needs a CasADi with its plugin, which CasADi "
            f"{casadi.__version__} as installed has not: use its wheel from PyPI"
        )


class CasadiConic:
    """min 1/2 x'Hx + g'x  s.t.  lba <= A x <= uba,  lbx <= x <= ubx, with a diagonal H.

    Parameters
    ----------
    casadi, plugin : the package, and the name of its QP plugin
    shape, indices, indptr : CSC pattern of A
    options : of the plugin

    Attributes
    ----------
    values : inputs by CasADi's names, to be written in place
    found : results of the last call by CasADi's names; the memory is used again by the next
    """

    def __init__(
        self,
        casadi: ModuleType,
        plugin: str,
        shape: tuple[int, int],
        indices: Any,
        indptr: Any,
        options: dict[str, Any],
    ) -> None:
        pattern = casadi.Sparsity(*shape, indptr.tolist(), indices.tolist())
        diagonal = casadi.Sparsity.diag(shape[1])
        both = {"error_on_fail": False, "record_time": True}
        self._function: Any = casadi.conic(
            "qp", plugin, {"h": diagonal, "a": pattern}, {**both, **options}
        )
        self._buffer, self._call = self._function.buffer()
        self.values: dict[str, Floats] = {}
        for name in IN:
            index = self._function.index_in(name)
            self.values[name] = np.zeros(self._function.nnz_in(index))
            self._buffer.set_arg(index, self.values[name].data)
        self.found = {
            name: np.zeros(self._function.nnz_out(self._function.index_out(name))) for name in OUT
        }
        self._clock_s = 0.0

    def solve(self, **values: Floats) -> dict[str, Any]:
        """Solve with new values; return CasADi's statistics, with the solver's own `own_s`."""
        for name, value in values.items():
            self.values[name][:] = value
        for name, memory in self.found.items():  # a call forgets where its results go
            self._buffer.set_res(self._function.index_out(name), memory.data)
        self._call()
        stats: dict[str, Any] = self._buffer.stats()
        now = float(stats["t_wall_solver"])  # the sum over all calls
        stats["own_s"], self._clock_s = now - self._clock_s, now
        return stats
