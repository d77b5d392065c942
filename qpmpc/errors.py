"""The exceptions of qpmpc, with one base class for callers to catch."""

from qpmpc.shown import shown


class QpmpcError(Exception):
    """Base class of every error raised on purpose by qpmpc.

    Its text may hold names and values of files: it is shown on one line, control characters
    escaped.
    """

    def __str__(self) -> str:
        return shown(super().__str__())


class InputError(QpmpcError):
    """A file, value or option given by the user cannot be used.

    The message is one line: it names the wrong input and what is allowed.
    The command line prints it and exits with code 2.
    """
