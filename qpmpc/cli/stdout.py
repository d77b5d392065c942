"""Standard output is for results: whatever solvers print while they work goes to stderr."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

STDOUT, STDERR = 1, 2  # file descriptors


@contextmanager
def to_stderr() -> Iterator[None]:
    """Send the output of Python and of C code to stderr while the block runs."""
    print(end="", flush=True)
    _flush_c()
    try:
        saved = os.dup(STDOUT)
        os.dup2(STDERR, STDOUT)
    except OSError:  # one of the two is closed: there is nothing to keep clean
        yield
        return
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _flush_c()  # C keeps what it prints into a pipe until then
        os.dup2(saved, STDOUT)
        os.close(saved)


def _flush_c() -> None:
    ctypes.CDLL(None).fflush(None)
