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
    """Compile without the GIL, and keep the machine code on disk where there is a place for it."""
    try:
        result = numba.njit(nogil=True, cache=True, error_model="numpy")(function)
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        result = numba.njit(nogil=True, error_model="numpy")(function)
    return cast(Function, result)
