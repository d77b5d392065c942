"""Lines that a user should read, said while the program runs."""

import logging
from functools import cache

from qpmpc.shown import shown


@cache
def say_once(line: str) -> None:
    """Say a line on stderr, where nobody has configured logging otherwise; once a process."""
    logging.getLogger("qpmpc").warning("%s", shown(line))
