"""How many processor cores dynamic programming uses unless it is told."""

import os

from qpmpc.errors import InputError
from qpmpc.pool import THREADS_VARIABLE, processes
from qpmpc.problems import shown_value

THREADS_MAX = 1024


def default_threads() -> int:
    """Return ``$QPMPC_THREADS``, else the number of cores that this process may use.

    Raises
    ------
    InputError
        If the variable is set to anything but an integer of 1 to 1024.
    """
    given = os.environ.get(THREADS_VARIABLE)
    if given:
        number = int(given) if given.isascii() and given.isdecimal() and len(given) <= 4 else 0
        if not 1 <= number <= THREADS_MAX:
            raise InputError(
                f"{THREADS_VARIABLE}: must be an integer from 1 to {THREADS_MAX} "
                f"(given: {shown_value(given)})"
            )
        return number
    return processes()
