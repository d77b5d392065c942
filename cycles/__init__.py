"""Drive cycles: the shipped ones with their sources, and import of users' files."""

from qpmpc.cycles.catalogue import CatalogueEntry, Figure, Published, catalogue, cycle_names
from qpmpc.cycles.cycle import Cycle
from qpmpc.cycles.load import load_cycle

__all__ = [
    "CatalogueEntry",
    "Cycle",
    "Figure",
    "Published",
    "catalogue",
    "cycle_names",
    "load_cycle",
]
