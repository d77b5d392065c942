"""What a project for a board says of itself: `replay.toml`, checked against its own files."""

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from qpmpc.codegen.generate import Precision
from qpmpc.codegen.method import Generated
from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.settings import load_toml, validated
from qpmpc.shown import shown

NAME = "replay.toml"
MEGABYTES_MAX = 1
SOURCE_MEGABYTES_MAX = 64
LONGEST_TRIP_S = 86_400
_PART = r"[A-Za-z0-9_-][A-Za-z0-9_.-]*"
_SOURCE = rf"^(?:{_PART}/){{0,4}}{_PART}\.[ch]$"
_TEXT = Annotated[str, Field(max_length=300)]


class Manifest(BaseModel):
    """A project for a board.

    Attributes
    ----------
    version : of qpmpc that made it
    target : cortex-m7 or linux
    controller, algorithm, precision, iterations : of the generated controller
    cycle, vehicle : their names
    prepared : whether a plan is made before the trip
    power_max_w : greatest power of the engine
    trip_s, seconds : length of the trip; seconds of it that are replayed
    files : SHA-256 of each source of controller and record, by name
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    version: _TEXT
    target: Literal["cortex-m7", "linux"]
    controller: Generated
    algorithm: Literal["admm", "osqp", "costate"]
    precision: Precision
    iterations: Annotated[int, Field(ge=1, le=1_000_000)]
    cycle: Annotated[str, Field(max_length=300, pattern=r"^[^/]+$")]
    vehicle: _TEXT
    prepared: bool
    power_max_w: Annotated[float, Field(gt=0.0, lt=1e9)]
    trip_s: Annotated[int, Field(ge=1, le=LONGEST_TRIP_S)]
    seconds: Annotated[int, Field(ge=1, le=LONGEST_TRIP_S)]
    files: Annotated[dict[str, _TEXT], Field(min_length=1, max_length=1000)]

    @property
    def identity(self) -> str:
        """16 hexadecimal digits that stand for sources and sizes; not for board or compiler."""
        parts = [self.controller, self.precision, str(self.seconds), str(self.trip_s)]
        parts += [f"{name} {digest}" for name, digest in sorted(self.files.items())]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]

    def text(self) -> str:
        """Return the content of `replay.toml`."""
        data = self.model_dump()
        files = data.pop("files")
        lines = ["# What this project is; written by qpmpc. Do not edit."]
        lines += [f"{key} = {_toml(value)}" for key, value in data.items()]
        lines += ["", "[files]", *(f"{_toml(name)} = {_toml(files[name])}" for name in files)]
        return "\n".join(lines) + "\n"


def digests(files: Mapping[str, str]) -> dict[str, str]:
    """Return the SHA-256 of each source among the files of a project, by name."""
    return {name: _digest(text) for name, text in sorted(files.items()) if re.match(_SOURCE, name)}


def load_manifest(folder: Path) -> Manifest:
    """Read what a project says of itself.

    Raises
    ------
    InputError
        If the folder holds none, or it names files that are no sources in it.
    """
    path = folder / NAME
    text = read_text(path, MEGABYTES_MAX, "--project ")
    manifest = validated(Manifest, load_toml(text, str(path)), str(path))
    for name in manifest.files:
        if not re.match(_SOURCE, name):
            raise InputError(f"{path}: {name!r} is no name of a source")
    return manifest


def _digest(source: str) -> str:
    return hashlib.sha256(source.encode()).hexdigest()


def is_as_written(path: Path, digest: str) -> bool:
    """Whether a source of a project can be read and still is what its digest was made of."""
    try:
        source = path.read_bytes().replace(b"\r\n", b"\n")
    except OSError:
        return False
    return hashlib.sha256(source).hexdigest() == digest


def load_sources(folder: Path, manifest: Manifest) -> dict[str, str]:
    """Read the sources of a project, by name.

    Raises
    ------
    InputError
        If one is not as it was written.
    """
    prefix, sources = f"--project {folder}: ", {}
    for name, digest in manifest.files.items():
        source = read_text(folder / name, SOURCE_MEGABYTES_MAX, prefix).replace("\r\n", "\n")
        if _digest(source) != digest:
            raise InputError(
                f"{prefix}{name} is not as it was written: make the project again, or put your "
                "changes into replay_port.c"
            )
        sources[name] = source
    return sources


def _toml(value: str | float | bool) -> str:
    return json.dumps(shown(value) if isinstance(value, str) else value, ensure_ascii=False)
