"""The one place that imports numba."""

from collections.abc import Callable
from typing import TypeVar, cast

from qpmpc.errors import QpmpcError

try:
    import numba
except ImportError as error:
    raise QpmpcError(
        "dynamic programming needs numba: install it with pip install 'qpmpc-iptm[verification]'"
    ) from error

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile without the GIL, and keep the machine code on disk where there is a place for it.

    For functions of one signature only: numba numbers those of a function in the order in which
    they come, and processes that start together could take one for another.
    """
    try:
        result = numba.njit(nogil=True, error_model="numpy", cache=True)(function)
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        result = numba.njit(nogil=True, error_model="numpy")(function)
    return cast(Function, result)


def inlined(function: Function) -> Function:
    """Compile a small function into its callers, whose machine code is kept."""
    return cast(Function, numba.njit(nogil=True, error_model="numpy", forceinline=True)(function))
