"""Find a cycle by its shipped name or its file."""

import os
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from qpmpc.cycles.breakpoints import read_breakpoints
from qpmpc.cycles.catalogue import CatalogueEntry, catalogue
from qpmpc.cycles.cycle import Cycle
from qpmpc.cycles.read_csv import read_csv
from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped

# the target of an added name is a Cycle, or the path of a CSV file
CYCLES = Names(
    "cycle",
    {entry.name: Shipped(entry.data) for entry in catalogue()},
    also=", or a CSV file",
)


def load_cycle(name_or_path: str | os.PathLike[str]) -> Cycle:
    """Load a shipped cycle by its name, or a user's CSV file by its path.

    The columns of a CSV file are ``time_s,speed_mps[,grade]``; see `read_csv`.

    Parameters
    ----------
    name_or_path
        One of `cycle_names`, or a file. A shipped name has priority over a file of that name.

    Raises
    ------
    InputError
        If it is neither, or the file cannot be used; one line with the reason and what is allowed.
    """
    name = os.fspath(name_or_path)
    for entry in catalogue():
        if entry.name == name:
            return _shipped(entry)
    if name in CYCLES:
        found = CYCLES.find(name)
        return found if isinstance(found, Cycle) else read_csv(Path(found), name=name)
    path = Path(name)
    # os.path: unlike Path.exists it does not raise on an impossible name
    if path.suffix == "" and path.name == name and not os.path.exists(name):  # noqa: PTH110
        raise InputError(CYCLES.unknown(name))
    return read_csv(path)


@cache
def _shipped(entry: CatalogueEntry) -> Cycle:
    with as_file(files("qpmpc.cycles").joinpath(entry.data)) as path:
        if entry.parts:
            return read_breakpoints(path, entry.parts, name=entry.name)
        return read_csv(path, name=entry.name)
