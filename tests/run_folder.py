"""A folder that all processes of one test run share."""

import os
from pathlib import Path

import pytest


def run_folder(factory: pytest.TempPathFactory, name: str) -> Path:
    """Return the folder of that name, common to all processes of this test run."""
    base = factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    folder.mkdir(exist_ok=True)
    return folder


def shared_cache(factory: pytest.TempPathFactory) -> str:
    """Return one cache of C libraries and dynamic programming, apart from the user's own.

    Pages, examples and notebooks drive the same car on the same cycles.
    """
    return str(run_folder(factory, "shared-cache"))
