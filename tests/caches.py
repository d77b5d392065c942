"""One cache of C libraries and of dynamic programming for tests that do what a user does."""

import os

import pytest


def shared_cache(factory: pytest.TempPathFactory) -> str:
    """Folder common to all processes of this test run, apart from the user's own cache.

    Pages, examples and notebooks drive the same car on the same cycles.
    """
    base = factory.getbasetemp()
    root = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    return str(root / "shared-cache")
