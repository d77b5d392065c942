"""Reading a user's text file: its name and size are checked before anything is made of it."""

import logging
import os
from pathlib import Path

from qpmpc.errors import InputError

NAME_BYTES_MAX = 255
"""Of one part of a path, as the file systems of Linux have it."""

PATH_BYTES_MAX = 4095
SHOWN = 100  # characters of a path that are shown
_log = logging.getLogger(__name__)


def shown_path(path: str | os.PathLike[str]) -> str:
    """Return a path for a message: with escapes for what is no text, cut where it is long."""
    text = os.fspath(path).encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def check_path(path: str | os.PathLike[str], prefix: str = "") -> None:
    """Check that a path can be one, and can be written into results, before it is used.

    Parameters
    ----------
    path : of an input or an output
    prefix : put before the path in the message

    Raises
    ------
    InputError
        If it is not UTF-8, has a null character, or is longer than a file system allows.
    """
    text, reason = os.fspath(path), ""
    try:
        parts = [len(part) for part in text.encode().split(b"/")]
        if max(parts) > NAME_BYTES_MAX or sum(parts) + len(parts) - 1 > PATH_BYTES_MAX:
            reason = f"too long: at most {NAME_BYTES_MAX} bytes a name, {PATH_BYTES_MAX} in all"
    except UnicodeEncodeError:
        reason = "the name is not UTF-8: rename it"
    if "\0" in text:
        reason = "the name has a null character"
    if reason:
        raise InputError(f"{prefix}{shown_path(text)}: {reason}")


def read_text(path: str | os.PathLike[str], megabytes: int, prefix: str = "") -> str:
    """Read a UTF-8 text file; a byte order mark is dropped, line ends stay as they are.

    Parameters
    ----------
    path : of a file, or of a pipe
    megabytes : largest size
    prefix : put before the path in messages

    Raises
    ------
    InputError
        If the name is impossible, or the file cannot be read, is too large, or is not text.
    """
    text = _decoded(read_bytes(path, megabytes, prefix), "utf-8-sig")
    if text is None:
        raise InputError(f"{prefix}{path}: must be plain text in UTF-8")
    return text


def read_table_text(path: str | os.PathLike[str], megabytes: int) -> tuple[str, str]:
    """Read the text of a table, which bench and spreadsheet programs write in Windows-1252 too.

    Numbers are the same in both; titles with an umlaut or a degree sign are not.

    Returns
    -------
    The text, and what was assumed about it in a line; empty for UTF-8.

    Raises
    ------
    InputError
        As of `read_text`; if it is neither.
    """
    content = read_bytes(path, megabytes)
    text = _decoded(content, "utf-8-sig")
    if text is not None:
        return text, ""
    text = _decoded(content, "cp1252")
    if text is None:
        raise InputError(f"{path}: must be plain text in UTF-8 or Windows-1252")
    return text, "the text is not UTF-8: read as Windows-1252"


def read_bytes(path: str | os.PathLike[str], megabytes: int, prefix: str = "") -> bytes:
    """Read a file of any content; parameters and errors as of `read_text`."""
    check_path(path, prefix)
    limit = megabytes * 1_000_000
    try:
        with Path(path).open("rb") as file:
            content = file.read(limit + 1)  # not by its size: a pipe or a device has none
    except OSError as error:
        reasons = {FileNotFoundError: "no such file", IsADirectoryError: "is a directory"}
        reason = reasons.get(type(error), f"cannot be read: {error.strerror}")
        raise InputError(f"{prefix}{path}: {reason}") from None
    if len(content) > limit:
        raise InputError(f"{prefix}{path}: larger than {megabytes} MB, the most that is read")
    _log.info("read %s, %d bytes", shown_path(path), len(content))
    return content


def _decoded(content: bytes, encoding: str) -> str | None:
    """Text without null characters, or None."""
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        return None
    return None if "\0" in text else text
