"""Writing results: checked before the work; afterwards files are complete or absent."""

import json
import os
from pathlib import Path
from typing import Any

from qpmpc.errors import InputError
from qpmpc.input_text import check_path


def check_folder(folder: Path, option: str) -> None:
    """Check, without making anything, that files can be written into a folder.

    Parameters
    ----------
    folder : existing, or to be made with its parents
    option : option that named it, for the error

    Raises
    ------
    InputError
        If it or the nearest existing parent is not a directory or cannot be written to.
    """
    check_path(folder, f"{option} ")
    nearest = folder
    while not nearest.exists():
        if nearest.is_symlink():
            raise InputError(f"{option} {folder}: {nearest} is a broken link")
        nearest = nearest.parent
    if not nearest.is_dir():
        raise InputError(f"{option} {folder}: {nearest} is a file, not a directory")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{option} {folder}: no permission to write into {nearest}")


def check_file(file: Path, option: str) -> None:
    """Check, without making anything, that a file can be written.

    Raises
    ------
    InputError
        If it is a directory, or its folder cannot be written to.
    """
    check_path(file, f"{option} ")
    if file.is_dir():
        raise InputError(f"{option} {file}: is a directory, give the name of a file")
    check_folder(file.parent, option)


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file in one go, making its folders: readers see the old one or all of the new."""
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(content)
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(file: Path, content: str) -> None:
    """Write UTF-8 text; see `write_bytes`."""
    write_bytes(file, content.encode())


def json_text(data: Any) -> str:
    """Return strict JSON, indented, with a final newline.

    Raises
    ------
    ValueError
        If a number is not finite: JSON does not allow it.
    """
    return json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
