"""Names that a user can type: shipped ones, and those that installed packages add to them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any

from qpmpc.errors import InputError
from qpmpc.nearest import nearest
from qpmpc.problems import shown_value
from qpmpc.remarks import say_once


@dataclass(frozen=True)
class Shipped:
    """The target of a shipped name, and its requirements beyond the core.

    Attributes
    ----------
    target : ``module:attribute``, imported when the name is used
    module, extra : package that it requires, and the extra that installs it
    settings : ``module:attribute`` of the model of its settings, if it has any of its own
    """

    target: str
    module: str = ""
    extra: str = ""
    settings: str = ""


class Names:
    """One kind of name.

    Another package adds names by entry points of the group ``qpmpc.KINDs``, for example in its
    pyproject.toml::

        [project.entry-points."qpmpc.controllers"]
        my-controller = "my_package.my_module:MyController"

    A shipped name cannot be replaced; of two packages that add the same, the first by target is
    used. Both are said.

    Parameters
    ----------
    kind : the kind, in the singular
    shipped : the names of this package, the default first
    also : other allowed inputs, for the error message
    beside : shipped names of another kind, among which a user chooses as well
    """

    def __init__(
        self,
        kind: str,
        shipped: Mapping[str, Shipped],
        also: str = "",
        beside: Mapping[str, Shipped] | None = None,
    ) -> None:
        self.kind, self.shipped, self._also = kind, shipped, also
        self._taken = {*shipped, *(beside or {})}

    @cached_property
    def added(self) -> dict[str, EntryPoint]:
        """Entry points of other packages by name."""
        found = sorted(entry_points(group=f"qpmpc.{self.kind}s"), key=lambda point: point.value)
        added: dict[str, EntryPoint] = {}
        for point in found:
            if point.name in self._taken:
                say_once(f"{self.kind} {point.name!r} of {point.value} is not used: a shipped name")
            elif point.name in added:
                used = added[point.name].value
                say_once(f"{self.kind} {point.name!r} of {point.value} is not used: {used} is")
            else:
                added[point.name] = point
        return added

    def names(self) -> tuple[str, ...]:
        """Return all names, the default first."""
        return (*self.shipped, *self.added)

    def __contains__(self, name: str) -> bool:
        return name in self.shipped or name in self.added

    def check(self, name: str) -> None:
        """Check that a name is known and that the package it needs is installed.

        Raises
        ------
        InputError
            If it is not; the message has the known names, the nearest first.
        """
        if name not in self:
            raise InputError(self.unknown(name))
        entry = self.shipped.get(name)
        if entry is not None and entry.module and find_spec(entry.module) is None:
            raise InputError(
                f"{self.kind} {name!r} needs {entry.module}: "
                f"pip install 'qpmpc-iptm[{entry.extra}]'"
            )

    def find(self, name: str) -> Any:
        """Import the target of a name.

        Raises
        ------
        InputError
            See `check`; or if another package's entry point cannot be imported.
        """
        self.check(name)
        if name in self.shipped:
            return _load(self.shipped[name].target)
        point = self.added[name]
        try:
            return point.load()
        except Exception as error:
            owner = point.dist.name if point.dist else "an installed package"
            reason = " ".join(str(error).split())  # such a message may have several lines
            raise InputError(
                f"{self.kind} {name!r} of {owner} cannot be loaded from {point.value}: "
                f"{type(error).__name__}: {reason}"
            ) from error

    def unknown(self, name: str, near: Iterable[str] = ()) -> str:
        """Return the error message for an unknown name; `near` as of `unknown`."""
        return unknown(self.kind, name, self.names(), self._also, near)

    def settings_model(self, name: str) -> Any:
        """Return the pydantic model of a name's settings, None if there is none."""
        if name in self.shipped:
            target = self.shipped[name].settings
            return _load(target) if target else None
        return getattr(self.find(name), "Settings", None)


def _load(target: str) -> Any:
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)


def unknown(
    kind: str, name: str, allowed: Iterable[str], also: str = "", near: Iterable[str] = ()
) -> str:
    """Return the message for an unknown name: the nearest known one and all others.

    Parameters
    ----------
    kind : of the name, in the singular
    name : as the user gave it
    allowed : all known names
    also : other allowed inputs, at the end of the message
    near : of these, names that may have been meant
    """
    names = tuple(allowed)
    use = f"use one of {', '.join(names)}{also}"
    return f"unknown {kind} {shown_value(name)}{hint(name, (*names, *near))} {use}"


def hint(name: str, allowed: Iterable[str]) -> str:
    """Return ``, did you mean 'nycc'?`` or, where no allowed name is near, a colon."""
    near = nearest(name, allowed)
    return f", did you mean {near!r}?" if near else ":"
