"""A file of rows, one line of JSON each: what has been written stays, whatever kills the writer."""

import errno
import json
import os
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any

from qpmpc.files import replace_file

Row = dict[str, Any]


class Journal:
    """An open journal.

    Parameters
    ----------
    file : replaced by one with the rows given
    rows : that it begins with
    """

    def __init__(self, file: Path, rows: list[Row]) -> None:
        content = b"".join(map(_line, rows))
        replace_file(file, content)
        self._file, self._whole = file, len(content)
        self._handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)

    def add(self, row: Row) -> None:
        """Append a row.

        Raises
        ------
        OSError
            If it cannot be written; the journal is then as it was before.
        """
        line = _line(row)
        if not os.fstat(self._handle).st_nlink:
            raise OSError(errno.ENOENT, "deleted while the study was running", str(self._file))
        try:
            if os.write(self._handle, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            os.ftruncate(self._handle, self._whole)
            raise OSError(error.errno, error.strerror, str(self._file)) from None
        self._whole += len(line)

    def close(self) -> None:
        """Close the file; it stays."""
        os.close(self._handle)


def rows_in(file: Path) -> Iterator[Row]:
    """Yield the rows of a journal; a last line that was cut off is none."""
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        return
    for line in content.split(b"\n")[:-1]:
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(row, dict) and type(row.get("run")) is int:
            yield row


def finite(row: Row) -> Row:
    """Replace what is not finite by null: JSON has no infinity."""
    return {
        key: None if isinstance(value, float) and not isfinite(value) else value
        for key, value in row.items()
    }


def _line(row: Row) -> bytes:
    return (json.dumps(finite(row), allow_nan=False) + "\n").encode()
