"""Find a cycle by its shipped name or its file."""

import os
from pathlib import Path

from qpmpc.cycles.catalogue import catalogue
from qpmpc.cycles.cycle import Cycle
from qpmpc.cycles.read_drive import read_drive
from qpmpc.cycles.shipped import shipped_cycle
from qpmpc.cycles.trips import ALLOWED, is_trip, looks_like_trip, make_trip, near_trips
from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped

# the target of an added name is a Cycle, or the path of a CSV file
CYCLES = Names(
    "cycle",
    {entry.name: Shipped(entry.data) for entry in catalogue()},
    also=f", a trip ({ALLOWED}), or a file (CSV, GPX, MDF)",
)


def load_cycle(name_or_path: str | os.PathLike[str]) -> Cycle:
    """Load a shipped cycle or a trip by its name, or a user's file by its path.

    A table has ``time_s,speed_mps[,grade]`` or the columns of a log; GPX and MDF are known by their
    suffixes; see `read_drive`. What was assumed about a file is in the cycle's `remarks`.

    Parameters
    ----------
    name_or_path
        One of `cycle_names`, a trip as `qpmpc.cycles.trips.make_trip` takes it, or a file, in this
        order of priority.

    Raises
    ------
    InputError
        If it is neither, or the file cannot be used; one line with the reason and what is allowed.
    """
    name = os.fspath(name_or_path)
    for entry in catalogue():
        if entry.name == name:
            return shipped_cycle(entry)
    if name in CYCLES:
        found = CYCLES.find(name)
        return found if isinstance(found, Cycle) else read_drive(Path(found), name=name)
    if is_trip(name):
        return make_trip(name)
    path = Path(name)
    # os.path: unlike Path.exists it does not raise on an impossible name
    if path.suffix == "" and path.name == name and not os.path.exists(name):  # noqa: PTH110
        if looks_like_trip(name):
            make_trip(name)  # says what is wrong with it
        raise InputError(CYCLES.unknown(name, near_trips(name)))
    return read_drive(path)
