"""The exceptions of qpmpc, with one base class for callers to catch."""


class QpmpcError(Exception):
    """Base class of every error raised on purpose by qpmpc."""


class InputError(QpmpcError):
    """A file, value or option given by the user cannot be used.

    The message is one line: it names the wrong input and what is allowed.
    The command line prints it and exits with code 2.
    """
