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
    return _compiled(function, inline=False)


def inlined(function: Function) -> Function:
    """Compile a small function into its callers, where its arguments need not be passed on."""
    return _compiled(function, inline=True)


def _compiled(function: Function, inline: bool) -> Function:
    def kept(on_disk: bool) -> object:
        make = numba.njit(nogil=True, error_model="numpy", forceinline=inline, cache=on_disk)
        return make(function)

    try:
        return cast(Function, kept(on_disk=True))
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        return cast(Function, kept(on_disk=False))
