"""Provenance of a result: versions, machine, time."""

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from qpmpc._version import __version__

PACKAGES = ("numpy", "scipy", "osqp")


def provenance() -> dict[str, str]:
    """Return the data needed to repeat the result or to judge its step times."""
    return {
        "qpmpc-iptm": __version__,
        "Python": platform.python_version(),
        **package_versions(),
        "processor": f"{_processor()}, {os.cpu_count()} logical cores",
        "system": f"{platform.system()} {platform.machine()}",
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that do the arithmetic."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def _processor() -> str:
    """Model of the processor; from a file on Linux, else from `platform`."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or "unknown"
