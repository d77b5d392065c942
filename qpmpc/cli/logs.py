"""The log of the command line: lines of the logger ``qpmpc``, on stderr."""

import logging
import sys

from qpmpc.errors import InputError
from qpmpc.names import unknown
from qpmpc.shown import shown

LEVELS = ("error", "warning", "info", "debug")
QUIET = "warning"


class _Stderr(logging.Handler):
    """Prints to the stderr of the moment: while a progress bar is shown, above the bar."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            print(shown(self.format(record)), file=sys.stderr)
        except BrokenPipeError:
            raise
        except Exception:
            self.handleError(record)


class _Lines(logging.Formatter):
    """Remarks as they are; of what is only logged, the level too."""

    def format(self, record: logging.LogRecord) -> str:
        text = record.getMessage()
        if record.levelno >= logging.WARNING:
            return text
        return f"{record.levelname.lower()}: {record.name}: {text}"


def set_log_level(level: str) -> None:
    """Print what the package logs from a level on.

    Raises
    ------
    InputError
        If there is no such level.
    """
    if level not in LEVELS:
        raise InputError(unknown("log level", level, LEVELS))
    logger = logging.getLogger("qpmpc")
    logger.setLevel(level.upper())
    for old in logger.handlers[:]:
        if isinstance(old, _Stderr):
            logger.removeHandler(old)
    handler = _Stderr()
    handler.setFormatter(_Lines())
    logger.addHandler(handler)
