"""Writing results: checked before the work; afterwards files are complete or absent."""

import json
import logging
import os
import re
import secrets
import sys
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG
from typing import Any

from qpmpc.errors import InputError, QpmpcError
from qpmpc.input_text import check_path
from qpmpc.shown import is_plain

MOST_LINKS = 40  # in a row, as in Linux
PERMISSIONS = 0o777
_log = logging.getLogger(__name__)


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
    try:
        while _stat(nearest) is None:
            if nearest.is_symlink():
                raise InputError(f"{option} {folder}: {nearest} is a broken link")
            nearest = nearest.parent
    except OSError as error:
        raise InputError(f"{option} {folder}: {error.strerror}") from error
    if not nearest.is_dir():
        raise InputError(f"{option} {folder}: {nearest} is a file, not a directory")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{option} {folder}: no permission to write into {nearest}")


def check_file(file: Path, option: str) -> None:
    """Check, without making anything, that a file can be written; see `write_bytes`.

    Raises
    ------
    InputError
        If it is a directory, or it or its folder cannot be written to.
    """
    check_path(file, f"{option} ")
    try:
        found = _stat(file)
    except OSError as error:
        raise InputError(f"{option} {file}: {error.strerror}") from error
    if file.is_dir():
        raise InputError(f"{option} {file}: is a directory, give the name of a file")
    target = _target(file)
    if found is not None and not _replaceable(file, found):
        if not os.access(file, os.W_OK):
            raise InputError(f"{option} {file}: no permission to write")
    elif file.is_symlink() and not target.parent.is_dir():
        raise InputError(f"{option} {file}: a link to {target}, whose folder does not exist")
    else:
        check_folder(target.parent, option)


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file, making its folders: readers see the old one or all of the new.

    A symbolic link stays one: the file that it leads to is written. What cannot be replaced and
    stay what it is, is written in place: a FIFO, a device, an open descriptor such as
    ``/dev/stdout``, a file with several names, of another owner or in a folder without permission.

    Raises
    ------
    QpmpcError
        If the reader of a FIFO leaves before the end.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    found = _stat(file)
    if found is None:
        replace_file(_target(file), content)
    elif _replaceable(file, found):
        replace_file(_target(file), content, mode=found.st_mode & PERMISSIONS)
    else:
        _write_in_place(file, content)
    _log.info("wrote %s, %d bytes", file, len(content))


def write_text(file: Path, content: str) -> None:
    """Write UTF-8 text; see `write_bytes`."""
    write_bytes(file, content.encode())


def write_texts(folder: Path, files: dict[str, str]) -> list[Path]:
    """Write texts by their names into a folder; returns the files. See `write_bytes`."""
    for name, text in files.items():
        write_text(folder / name, text)
    return [folder / name for name in files]


def replace_file(
    file: Path, content: bytes, mode: int | None = None, durable: bool = False
) -> None:
    """Put a new file in the place of any of that name, in one step.

    Parameters
    ----------
    file : in an existing folder; not a link
    content : of the file
    mode : its permissions; those of any new file if None
    durable : whether it shall be complete even after a power failure, which takes longer
    """
    # a name that nobody can guess, and "x": nothing that is there already is opened
    temporary = file.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        stream = temporary.open("xb")
        try:
            with stream:
                if mode is not None:
                    os.fchmod(stream.fileno(), mode)
                stream.write(content)
                if durable:
                    stream.flush()
                    os.fsync(stream.fileno())
            temporary.replace(file)
        finally:
            temporary.unlink(missing_ok=True)
        if durable:
            _sync_folder(file.parent)
    except OSError as error:  # of the file that the user knows, not of the temporary one
        raise OSError(error.errno, error.strerror, str(file)) from error


def json_text(data: Any) -> str:
    r"""Return strict JSON, indented, with a final newline.

    Characters that are not printed are escaped (``\u009b``): the same data, and no effect on a
    terminal.

    Raises
    ------
    ValueError
        If a number is not finite: JSON does not allow it.
    """
    text = json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False)
    return re.sub(r"[^\n -~]", _json_escaped, text) + "\n"


def _json_escaped(match: re.Match[str]) -> str:
    character = match[0]
    return character if is_plain(character) else json.dumps(character)[1:-1]


def _stat(file: Path) -> os.stat_result | None:
    """Return what is there, links followed; None if nothing is."""
    with suppress(FileNotFoundError, NotADirectoryError):
        return file.stat()
    return None


def _target(file: Path) -> Path:
    """Return where links lead."""
    return Path(os.path.realpath(file))


def _replaceable(file: Path, found: os.stat_result) -> bool:
    """Whether a new file in its place would be the same to everybody else."""
    return (
        S_ISREG(found.st_mode)
        and found.st_nlink == 1
        and found.st_uid == os.geteuid()
        and os.access(_target(file).parent, os.W_OK | os.X_OK)
        and _descriptor(file) is None
    )


def _write_in_place(file: Path, content: bytes) -> None:
    descriptor = _descriptor(file)
    try:
        if descriptor is None:
            opened = os.open(file, os.O_WRONLY | os.O_TRUNC)
        else:
            # not by its name: that would begin again at the start of the file behind it
            sys.stdout.flush()
            opened = os.dup(descriptor)
        with open(opened, "wb") as stream:  # noqa: PTH123
            stream.write(content)
    except BrokenPipeError as error:
        if descriptor == 1:
            raise  # as with any output to a reader that has enough
        raise QpmpcError(f"{file}: the reader left before the end") from error
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error


def _descriptor(file: Path) -> int | None:
    """Return the descriptor of this process that a path such as /dev/stdout names, if it does."""
    here = file.absolute()
    for _ in range(MOST_LINKS):
        if os.path.realpath(here.parent) in (f"/proc/{os.getpid()}/fd", "/dev/fd"):
            return int(here.name) if here.name.isdecimal() else None
        if not here.is_symlink():
            break
        here = here.parent / here.readlink()
    return None


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems do not sync folders
            os.fsync(handle)
    finally:
        os.close(handle)


def around_marks(page: Path, begin: str, end: str) -> tuple[str, str]:
    """Return the text of a page up to its first mark, and from its second on, marks included.

    Raises
    ------
    InputError
        If the page has not both, in this order.
    """
    text = page.read_text("utf-8")
    if not 0 <= text.find(begin) < text.find(end):
        raise InputError(f"{page}: no marks {begin} and {end}")
    return text.partition(begin)[0] + begin, end + text.partition(end)[2]
