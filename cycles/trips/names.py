"""Names of trips: ``train-017``, ``judge-017``, ``random-5``, ``random-5-600s``."""

import re
from typing import NamedTuple

from qpmpc.errors import InputError
from qpmpc.names import hint, unknown
from qpmpc.nearest import nearest
from qpmpc.problems import shown_value

SETS: dict[str, int] = {"train": 200, "judge": 200}
"""Number of trips in each set."""

SHORTEST_S, LONGEST_S = 120, 7200
SEEDS = 2**31

ALLOWED = (
    ", ".join(f"{name}-000 .. {name}-{size - 1:03d}" for name, size in SETS.items())
    + ", random-SEED[-SECONDSs]"
)
"""The names of all trips, for messages."""

_OF_SET = re.compile(rf"({'|'.join(SETS)})-([0-9]{{3}})")
_RANDOM = re.compile(r"random-(0|[1-9][0-9]{0,9})(?:-([1-9][0-9]{0,4})s)?")
# a name as it may be mistyped: its letters, the first number, the seconds
_TYPED = re.compile(r"([a-z]{1,20})[-_ ]*([0-9]{1,10})(?:[-_ ]*([0-9]{1,5})s?)?", re.ASCII)


class TripName(NamedTuple):
    """A name taken apart.

    Attributes
    ----------
    group : ``train``, ``judge`` or ``random``
    number : of the trip in its set, or the seed
    duration_s : where the name has one
    """

    group: str
    number: int
    duration_s: int | None


def set_names(name: str) -> tuple[str, ...]:
    """Names of the trips of a set.

    Raises
    ------
    InputError
        If there is no such set.
    """
    if name not in SETS:
        raise InputError(unknown("set of trips", name, SETS))
    return tuple(f"{name}-{i:03d}" for i in range(SETS[name]))


def is_trip(name: str) -> bool:
    """Whether `make_trip` makes a trip of this name."""
    return _parsed(name) is not None


def looks_like_trip(name: str) -> bool:
    """Whether a name begins like that of a trip, right or wrong."""
    return name.startswith(tuple(f"{group}-" for group in (*SETS, "random")))


def near_trips(name: str) -> tuple[str, ...]:
    """Names of trips that differ from a mistyped one in the letters, in dashes or in zeros."""
    typed = _TYPED.fullmatch(name.casefold())
    group = nearest(typed[1], (*SETS, "random")) if typed else ""
    if not typed or not group:
        return ()
    number, seconds = int(typed[2]), f"-{int(typed[3])}s" if typed[3] else ""
    meant = f"{group}-{number:03d}" if group in SETS else f"{group}-{number}{seconds}"
    return (meant,) if is_trip(meant) else ()


def parse_name(name: str) -> TripName:
    """Take a name apart.

    Raises
    ------
    InputError
        If it is not the name of a trip; the message says what is allowed.
    """
    found = _parsed(name)
    if found is None:
        raise InputError(
            f"unknown trip {shown_value(name)}{hint(name, near_trips(name))} use one of {ALLOWED}; "
            f"SEED 0 .. {SEEDS - 1}, SECONDS {SHORTEST_S} .. {LONGEST_S}, no leading zeros"
        )
    return found


def _parsed(name: str) -> TripName | None:
    if match := _OF_SET.fullmatch(name):
        number = int(match[2])
        return TripName(match[1], number, None) if number < SETS[match[1]] else None
    if match := _RANDOM.fullmatch(name):
        seed, duration_s = int(match[1]), int(match[2]) if match[2] else None
        if seed < SEEDS and (duration_s is None or SHORTEST_S <= duration_s <= LONGEST_S):
            return TripName("random", seed, duration_s)
    return None
