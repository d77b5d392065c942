"""Studies by name, from files and from mappings."""

import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from qpmpc.cycles.trips import SETS, set_names
from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.names import unknown
from qpmpc.settings import load_toml, validated
from qpmpc.study.definition import Study
from qpmpc.study.sampling import KINDS

MEGABYTES_MAX = 4
FILES = ("cycle", "vehicle", "faults")  # keys whose values may be files
_SHIPPED = resources.files("qpmpc.study") / "shipped"


def load_study(name_or_path: str | os.PathLike[str]) -> Study:
    """Load a study: a shipped name or a TOML file with the keys of `Study`.

    Files that it names are looked for from its own folder.

    Raises
    ------
    InputError
        If there is no such study or file, or a key or value is not allowed; one line.
    """
    name = os.fspath(name_or_path)
    if name in shipped_studies():
        return as_study(load_toml(shipped_text(name), name), name)
    path = Path(name)
    if path.suffix == "" and path.name == name and not os.path.exists(name):  # noqa: PTH110
        raise InputError(unknown("study", name, shipped_studies(), ", or a .toml file"))
    text = read_text(path, MEGABYTES_MAX, "study ")
    return as_study(load_toml(text, name), name, path.parent)


def shipped_studies() -> tuple[str, ...]:
    """Return the names of the studies that come with the package."""
    return tuple(sorted(f.name.removesuffix(".toml") for f in _SHIPPED.iterdir()))


def shipped_text(name: str) -> str:
    """Return the file of a shipped study."""
    return (_SHIPPED / f"{name}.toml").read_text("utf-8")


def as_study(data: Mapping[str, Any], owner: str = "study", folder: Path | None = None) -> Study:
    """Make a study of a mapping with the keys of `Study`.

    Parameters
    ----------
    owner : for messages
    folder : from which the files it names are looked for; the current one if None

    Raises
    ------
    InputError
        If a key or value is not allowed.
    """
    return validated(Study, _located(dict(data), folder or Path()), owner)


def _located(value: Any, folder: Path, key: str = "") -> Any:
    """Put the folder before the files in a study's tables, and trips for sets of trips.

    What Python has more than TOML, arrays of numpy, tuples and paths, becomes TOML's.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    elif isinstance(value, tuple | range):
        value = list(value)
    elif isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, Mapping):
        names = {k: key if k in KINDS else str(k) for k in value}
        return {str(k): _located(inner, folder, names[k]) for k, inner in value.items()}
    if isinstance(value, list):
        each = _expanded(value) if key == "cycle" else value
        return [_located(inner, folder, key) for inner in each]
    is_file = key in FILES and isinstance(value, str) and (Path(value).suffix or "/" in value)
    return str(folder / value) if is_file else value


def _expanded(cycles: list[Any]) -> list[Any]:
    found: list[Any] = []
    for name in cycles:
        found += set_names(name) if isinstance(name, str) and name in SETS else [name]
    return found
