"""Other programs, run for a limited time, with a limited answer."""

import os
import select
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from time import monotonic
from typing import NamedTuple

MOST_BYTES = 64 * 1024
PIECE = 4096


class Answer(NamedTuple):
    """What a program answered.

    Attributes
    ----------
    text : stdout and stderr together, at most `MOST_BYTES`
    fault : why it is no answer, in a few words; empty if it ended well
    """

    text: str
    fault: str


def ask(command: Sequence[str], limit_s: float, given: bytes = b"") -> Answer:
    """Run a program; it, and what it started, is killed after the time or too long an answer.

    Parameters
    ----------
    command : path and arguments
    given : its standard input, shorter than a pipe holds
    """
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    except (OSError, ValueError) as error:
        return Answer("", getattr(error, "strerror", None) or str(error))
    assert process.stdin is not None
    assert process.stdout is not None
    with process.stdout as output:
        with suppress(OSError):
            process.stdin.write(given)
            process.stdin.close()
        content, fault, end = b"", "", monotonic() + limit_s
        while not fault:
            ready, _, _ = select.select([output], [], [], max(0.0, end - monotonic()))
            if not ready:
                fault = f"no answer in {limit_s:g} s"
                break
            read = os.read(output.fileno(), PIECE)
            content += read
            if not read:
                break
            if len(content) > MOST_BYTES:
                fault = "answers without end"
        if not fault:
            try:
                process.wait(max(0.1, end - monotonic()))
            except subprocess.TimeoutExpired:
                fault = f"does not end in {limit_s:g} s"
        with suppress(OSError):  # nothing of it may be left, its own children included
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if not fault and process.returncode:
        code = process.returncode
        fault = f"killed by signal {-code}" if code < 0 else f"exit code {code}"
    return Answer(content[:MOST_BYTES].decode("utf-8", "replace"), fault)
