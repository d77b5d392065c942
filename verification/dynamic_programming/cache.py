"""Results on disk, keyed by all their inputs."""

import json
import os
import tempfile
from contextlib import suppress
from dataclasses import fields
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.vehicle import Vehicle
from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solution import DpLevel, DpSolution

PACKAGES = ("qpmpc.vehicle", "qpmpc.verification.dynamic_programming")


def folder() -> Path:
    """Return ``$QPMPC_CACHE_DIR``, else ``qpmpc`` in ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    chosen = os.environ.get("QPMPC_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path("~/.cache").expanduser()) / "qpmpc"


def key(cycle: Cycle, vehicle: Vehicle, settings: DpSettings) -> str:
    """Hash of cycle, vehicle, grids and the source of plant and method."""
    digest = sha256(_source().encode())
    digest.update(cycle.name.encode() + b"\0")
    for array in (cycle.speed_mps, cycle.grade):
        digest.update(str(len(array)).encode() + array.tobytes())
    digest.update(vehicle.model_dump_json().encode())
    digest.update(settings.model_dump_json(exclude={"threads"}).encode())
    return digest.hexdigest()


def load(name: str) -> DpSolution | None:
    """Return the result of that key; None if there is none or it cannot be read."""
    try:
        # numpy leaves a file open that it opened itself and cannot read
        with _path(name).open("rb") as file, np.load(file, allow_pickle=False) as data:
            text = json.loads(str(data["text"]))
            arrays = {field: data[field] for field in data.files if field != "text"}
        levels = tuple(DpLevel(*level) for level in text.pop("levels"))
        return DpSolution(**arrays, **text, levels=levels)
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile):
        return None


def store(name: str, solution: DpSolution) -> None:
    """Write the result in one go; where the folder cannot be written, do nothing."""
    values = {field.name: getattr(solution, field.name) for field in fields(solution)}
    arrays = {k: v for k, v in values.items() if isinstance(v, np.ndarray)}
    text = json.dumps({k: v for k, v in values.items() if k not in arrays})
    path = _path(name)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(file, allow_pickle=False, text=np.array(text), **arrays)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def _path(name: str) -> Path:
    return folder() / f"dp-{name[:32]}.npz"


@cache
def _source() -> str:
    texts = [
        file.read_text("utf-8")
        for package in PACKAGES
        for file in sorted(files(package).iterdir(), key=lambda f: f.name)
        if file.name.endswith(".py")
    ]
    return "\0".join(texts)
