"""The optional packages that read formats other than text."""

from importlib.util import find_spec
from pathlib import Path

from qpmpc.errors import InputError

LOGS_EXTRA = "pip install 'qpmpc-iptm[logs]'"


def need(path: Path, module: str) -> None:
    """Check that an optional package is there.

    Raises
    ------
    InputError
        If it is not installed; with the command that does it.
    """
    if find_spec(module) is None:
        raise InputError(f"{path}: reading it needs {module}, which is not installed: {LOGS_EXTRA}")
