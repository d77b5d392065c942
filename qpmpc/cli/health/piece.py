"""One thing that the package uses, and how it was found."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

State = Literal["ok", "missing", "broken"]


@dataclass(frozen=True)
class Piece:
    """A package, a tool or a folder.

    Attributes
    ----------
    group : ``core`` or the extra that a package belongs to, ``tools``, ``folders``
    name : of the package, command or folder
    state : ``broken`` is there, but cannot be used
    found : its version or place; what is wrong if it is broken
    disables : what does not work without it
    remedy : command that brings it
    needed : whether nothing works without it
    """

    group: str
    name: str
    state: State
    found: str
    disables: str
    remedy: str
    needed: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return its fields."""
        return asdict(self)
