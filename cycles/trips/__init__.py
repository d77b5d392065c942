"""Random trips by name: the sets ``train`` and ``judge``, and any other by its seed."""

from qpmpc.cycles.trips.make import make_trip
from qpmpc.cycles.trips.names import (
    ALLOWED,
    SETS,
    is_trip,
    looks_like_trip,
    near_trips,
    set_names,
)

__all__ = [
    "ALLOWED",
    "SETS",
    "is_trip",
    "looks_like_trip",
    "make_trip",
    "near_trips",
    "set_names",
]
