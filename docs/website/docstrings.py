"""Our docstrings as griffe reads numpy's: one line ``name : meaning`` is an entry without type."""

import re
from typing import Any

import griffe

SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n(.*?)(?=^\w[\w ]*\n-{3,}\n|\Z)", re.M | re.S)
ENTRY = re.compile(r"^([*\w]+(?:, [*\w.]+)*) : (.+(?:\n {4,}.+)*)$", re.M)
WITH_NAMES = {"Parameters", "Attributes", "Other Parameters", "Methods"}


def _entry(found: re.Match[str]) -> str:
    names, meaning = found.groups()
    return "\n".join(f"{name}\n    {meaning}" for name in names.split(", "))  # each has a type


def _section(found: re.Match[str]) -> str:
    title, body = found.groups()
    if title in WITH_NAMES:
        body = ENTRY.sub(_entry, body)
    return f"{title}\n{'-' * len(title)}\n{body}"


class OneLineEntries(griffe.Extension):
    """Turns each docstring into numpy's own form before it is parsed."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_section, obj.docstring.value)
