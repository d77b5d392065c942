"""The nearest allowed name to one that is unknown, for messages."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 100  # characters of an unknown name that are compared
CUTOFF = 0.6  # of difflib's ratio


def nearest(name: str, allowed: Iterable[str], cutoff: float = CUTOFF) -> str:
    """Return the allowed name that was probably meant; empty if none is near.

    Case and the choice between ``-``, ``_`` and space do not count; a name that only one begins
    with, three letters at least, is near.
    """
    plain = {_plain(each): each for each in allowed}
    wanted = _plain(name[:LONGEST])
    close = get_close_matches(wanted, plain, n=1, cutoff=cutoff)
    begun = [each for each in plain if len(wanted) >= 3 and each.startswith(wanted)]
    if wanted not in plain and len(begun) == 1:
        close = begun
    return plain[close[0]] if close else ""


def _plain(name: str) -> str:
    return name.casefold().replace("_", "-").replace(" ", "-")
