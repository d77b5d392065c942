"""Circumstances that nobody wishes for: shared by the tests of what is written and shown."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager

# what colours a terminal (in seven bits and in eight), turns the direction of writing, ends a line,
# is markup to rich, HTML and matplotlib
TEXT = "a\x1b[31m\x9b1m\u202e\n[red]$x^$<b>\x7f"
AS_SHOWN = r"a\x1b[31m\x9b1m\u202e\n[red]$x^$<b>\x7f"


@contextmanager
def limited_disk(size: int) -> Iterator[None]:
    """Let no file grow beyond a size, as on a full disk: the kernel refuses the rest."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def is_harmless(text: str) -> bool:
    """Whether it has no control characters but line ends."""
    return all(c.isprintable() or c == "\n" for c in text)
