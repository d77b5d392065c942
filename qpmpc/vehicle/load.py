"""Vehicle files: shipped ones by name, any by path, each alone or on top of a base.

A file with ``base = "prius-nimh"``, or the path of another file, needs only its own ``name``
and the keys that differ. Tables are merged key by key; an array is replaced whole.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.problems import shown_value
from qpmpc.settings import load_toml, validated
from qpmpc.vehicle.engine_parameters import LINE, LINE_TOO, MAP
from qpmpc.vehicle.names import DEFAULT_VEHICLE, VEHICLES
from qpmpc.vehicle.parameters import Vehicle

MEGABYTES_MAX = 1
"""A vehicle's file has some kilobytes."""


@dataclass(frozen=True)
class VehicleFile:
    """Content of one file, before its base is merged in.

    Attributes
    ----------
    label : its name in errors: the shipped vehicle's name, or the path
    path : None for a shipped vehicle
    text, data : as written, and parsed
    """

    label: str
    path: Path | None
    text: str
    data: dict[str, Any]


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the shipped vehicles, the default first."""
    return tuple(VEHICLES.shipped)


def load_vehicle(name_or_path: str | os.PathLike[str] = DEFAULT_VEHICLE) -> Vehicle:
    """Load a shipped vehicle by name, or any vehicle from a TOML file.

    Raises
    ------
    InputError
        If the name is unknown, the file or one of its bases cannot be read, or a key or value is
        not allowed.
    """
    return merged_vehicle(vehicle_files(name_or_path))


def vehicle_files(name_or_path: str | os.PathLike[str]) -> tuple[VehicleFile, ...]:
    """Read a vehicle's file, its base, the base of that, and so on.

    Raises
    ------
    InputError
        If one cannot be read or is not TOML, or if the bases form a circle.
    """
    files = [_read(name_or_path, "")]
    while "base" in files[-1].data:
        base = _read_base(files[-1])
        files.append(base)
        if any(_same(base, earlier) for earlier in files[:-1]):
            circle = " -> ".join(file.label for file in files)
            raise InputError(f"{files[0].label}: its bases go round in a circle: {circle}")
    return tuple(files)


def merged_vehicle(files: tuple[VehicleFile, ...]) -> Vehicle:
    """Build the vehicle of a file and its bases, the file first.

    Raises
    ------
    InputError
        If a key is missing or unknown or a value is not allowed; the message names the file.
    """
    data: dict[str, Any] = {}
    for file in reversed(files):
        own = {key: value for key, value in file.data.items() if key != "base"}
        data = _merged(_without_other_engine(data, own), own)
    if "name" not in files[0].data:
        data.pop("name", None)  # two vehicles of one name could not be told apart in results
    labels = {key: file.label for key, file in origins(files).items()}
    return validated(Vehicle, data, files[0].label, labels)


def origins(files: tuple[VehicleFile, ...]) -> dict[str, VehicleFile]:
    """Map each dotted key to the file whose value applies."""
    return {key: file for file in reversed(files) for key in _dotted_keys(file.data)}


def _read_base(file: VehicleFile) -> VehicleFile:
    base = file.data["base"]
    if not isinstance(base, str):
        raise InputError(
            f"{file.label}: base must be the name of a shipped vehicle or of a .toml file "
            f"(given: {shown_value(base)})"
        )
    if base in VEHICLES or file.path is None:
        return _read(base, f"{file.label}: base: ")
    # relative to the file that names it, so that a folder of vehicles can be moved
    path = file.path.parent / base
    return _read(path if path.suffix == ".toml" else base, f"{file.label}: base: ")


def _read(name_or_path: str | os.PathLike[str], where: str) -> VehicleFile:
    label = os.fspath(name_or_path)
    if label in VEHICLES.shipped:
        text = (resources.files("qpmpc.vehicle") / "data" / f"{label}.toml").read_text("utf-8")
        return VehicleFile(label, None, text, load_toml(text, label))
    path = Path(VEHICLES.find(label) if label in VEHICLES.added else label)
    if path.suffix != ".toml":
        raise InputError(f"{where}{VEHICLES.unknown(label)}")
    text = read_text(path, MEGABYTES_MAX, f"{where}vehicle file ")
    return VehicleFile(label, path, text, load_toml(text, label))


def _same(one: VehicleFile, other: VehicleFile) -> bool:
    if one.path is None or other.path is None:
        return one.path is other.path and one.label == other.label
    return one.path.resolve() == other.path.resolve()


def _merged(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Put one file's tables and values over those of its base: a vehicle's tables are flat."""
    result = dict(base)
    for key, value in own.items():
        under = result.get(key)
        if isinstance(value, dict) and isinstance(under, dict):
            result[key] = {**under, **value}
        else:
            result[key] = value
    return result


def _without_other_engine(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Drop what a base says of the engine's fuel where a file says it in another way.

    A line replaces a map and a map a line, and a new line the speeds of the old one.
    """
    under, over = base.get("engine"), own.get("engine")
    if not (isinstance(under, dict) and isinstance(over, dict)):
        return base
    of_line = (*LINE, *LINE_TOO)
    dropped: tuple[str, ...] = ()
    if any(key in over for key in of_line):
        dropped = (*MAP, *LINE_TOO) if LINE[0] in over else MAP
    elif any(key in over for key in MAP):
        dropped = of_line
    return {**base, "engine": {k: v for k, v in under.items() if k not in dropped}}


def _dotted_keys(data: dict[str, Any]) -> Iterator[str]:
    """Keys of tables and of the values in them, such as ``battery`` and ``battery.soc_min``."""
    for key, value in data.items():
        yield key
        if isinstance(value, dict):
            yield from (f"{key}.{inner}" for inner in value)
