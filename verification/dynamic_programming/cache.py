"""Results on disk, keyed by all their inputs, each computed by one process only.

The folder may hold other files: only ``dp-*`` are ours.
"""

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from fcntl import LOCK_EX, flock
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

MOST_BYTES = 2e9  # of all results together: some 25 000 trips of half an hour
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
    tube = (settings.tube_soc, settings.tube_t_cl_k)
    digest.update(json.dumps([settings.cells, tube]).encode())
    return digest.hexdigest()


def load(name: str) -> DpSolution | None:
    """Return the result of that key; None if there is none or it cannot be read."""
    path = _path(name)
    try:
        # numpy leaves a file open that it opened itself and cannot read
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            text = json.loads(str(data["text"]))
            arrays = {field: data[field] for field in data.files if field != "text"}
        levels = tuple(DpLevel(*level) for level in text.pop("levels"))
        solution = DpSolution(**arrays, **text, levels=levels)
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile):
        return None
    with suppress(OSError):  # a folder that may only be read
        os.utime(path)  # the last to be deleted
    return solution


@contextmanager
def alone(name: str) -> Iterator[None]:
    """Wait until no other process holds this key, and hold it; a process that dies lets it go.

    Where there can be no locks nobody waits: some results are then computed twice.
    """
    handle = None
    with suppress(OSError):
        handle = _locked(_path(name).with_suffix(".lock"))
    try:
        yield
    finally:
        if handle is not None:
            with suppress(OSError):
                _path(name).with_suffix(".lock").unlink()
            os.close(handle)


def _locked(path: Path) -> int:
    """Return a locked descriptor of the file that has this name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            flock(handle, LOCK_EX)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), path.stat()):
                    return handle
        except BaseException:  # no locks here, or Ctrl-C while waiting
            os.close(handle)
            raise
        os.close(handle)  # of a file that its last holder has removed


def store(name: str, solution: DpSolution) -> None:
    """Write the result in one go; where the folder cannot be written, do nothing."""
    values = {field.name: getattr(solution, field.name) for field in fields(solution)}
    arrays = {k: v for k, v in values.items() if isinstance(v, np.ndarray)}
    text = json.dumps({k: v for k, v in values.items() if k not in arrays})
    path = _path(name)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix="dp-", suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(file, allow_pickle=False, text=np.array(text), **arrays)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        _bound(path)


def _bound(newest: Path) -> None:
    """Delete the results, and what broken writes left, that were not used for longest."""
    found = []
    for pattern in ("dp-*.npz", "dp-*.tmp"):
        for file in newest.parent.glob(pattern):
            with suppress(FileNotFoundError):  # renamed or deleted meanwhile
                stat = file.stat()
                found.append((stat.st_mtime, stat.st_size, file))
    total = 0
    for _, size, file in sorted(found, reverse=True):
        total += size
        if total > MOST_BYTES and file != newest:
            file.unlink(missing_ok=True)


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
