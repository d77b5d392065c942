"""Reading in a process of its own, for a library of native code that a broken file may crash."""

import atexit
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from signal import Signals
from threading import Lock

from qpmpc.cycles.logs.columns import LogColumns
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.errors import InputError

Reader = Callable[[Path, LogOptions], LogColumns]

_CHILD = "from qpmpc.cycles.logs.apart import serve; serve()"
_lock = Lock()
_children: dict[int, "subprocess.Popen[bytes]"] = {}
"""Of this process, by its number: a copy of it (fork) must not share the pipes. It lives on for
the next file, as starting one takes most of a second."""


def read_apart(reader: Reader, path: Path, options: LogOptions) -> LogColumns:
    """Return what a reader, a function of a module, finds in a file, from another process.

    Raises
    ------
    InputError
        The reader's own; or that the file crashed it.
    """
    with _lock:
        child = _children.pop(os.getpid(), None) or _start()
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            pickle.dump((reader, Path.cwd(), path, options), child.stdin)
            child.stdin.flush()
            found = pickle.load(child.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            raise InputError(f"{path}: it crashes what reads it: {_end(child)}") from None
        except BaseException:  # Ctrl-C: its answer would be taken for the next file's
            _end(child)
            raise
        _children[os.getpid()] = child
    if isinstance(found, InputError):
        raise found
    assert isinstance(found, LogColumns)
    return found


def _start() -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # what the library says of a broken file
    )


def _end(child: "subprocess.Popen[bytes]") -> str:
    """End a process; return how it ended, where it did so by itself."""
    for pipe in (child.stdin, child.stdout):
        with suppress(OSError):  # what is left in it for one that is no more
            if pipe is not None:
                pipe.close()
    try:
        code = child.wait(1.0)
    except subprocess.TimeoutExpired:
        child.kill()
        code = child.wait()
    return Signals(-code).name if code < 0 else f"exit code {code}"


@atexit.register
def _end_own() -> None:
    child = _children.pop(os.getpid(), None)
    if child is not None:
        _end(child)


def serve() -> None:
    """Answer requests on standard input, until it is closed."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    while True:
        try:
            reader, folder, path, options = pickle.load(requests)
        except EOFError:
            return
        os.chdir(folder)
        try:
            found = reader(path, options)
        except InputError as error:
            found = error
        pickle.dump(found, answers)
        answers.flush()
