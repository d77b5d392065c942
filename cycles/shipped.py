"""The shipped cycles, read from their files."""

from functools import cache
from importlib.resources import as_file, files

from qpmpc.cycles.breakpoints import read_breakpoints
from qpmpc.cycles.catalogue import CatalogueEntry
from qpmpc.cycles.cycle import Cycle
from qpmpc.cycles.read_drive import read_drive


@cache
def shipped_cycle(entry: CatalogueEntry) -> Cycle:
    """Read the cycle of a catalogue entry."""
    with as_file(files("qpmpc.cycles").joinpath(entry.data)) as path:
        if entry.parts:
            return read_breakpoints(path, entry.parts, name=entry.name)
        return read_drive(path, name=entry.name)
