"""What a result depends on besides its inputs: this package's files and the versions of others."""

import platform
from functools import cache
from hashlib import sha256
from importlib import resources
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING

from qpmpc.report.provenance import package_versions

if TYPE_CHECKING:
    from hashlib import _Hash as Hash

ROOTS = ("qpmpc", "qpmpc.codegen", "qpmpc.cycles", "qpmpc.verification")
NO_RESULT = ("__pycache__", "report", "cli")  # folders that no run depends on
READ = (".py", ".toml", ".csv", ".c", ".h", ".j2")


@cache
def code_hash() -> str:
    """Hash the files of this package that results depend on."""
    digest = sha256()
    for root in ROOTS:
        _add(digest, resources.files(root), root)
    return digest.hexdigest()[:32]


@cache
def versions() -> str:
    """Return the versions of Python and of the packages that do the arithmetic."""
    found = {"Python": platform.python_version(), **package_versions()}
    return ", ".join(f"{name} {version}" for name, version in found.items())


def _add(digest: "Hash", folder: Traversable, name: str) -> None:
    for inner in sorted(folder.iterdir(), key=lambda each: each.name):
        path = f"{name}/{inner.name}"
        if inner.is_dir():
            if inner.name not in NO_RESULT:
                _add(digest, inner, path)
        elif inner.name.endswith(READ):
            digest.update(f"{path}\0".encode() + inner.read_bytes() + b"\0")
