"""Build the site: ``make docs`` calls this with the folder to write to.

The notebooks are executed first, by nbmake, so that the pages show what they print and draw; a cell
that fails, a warning of mkdocs, a broken link and a page that is not in the navigation end it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NBMAKE = [
    "-m",
    "pytest",
    "-q",
    "-c",
    os.devnull,
    "--nbmake",
    "--overwrite",
    "-p",
    "no:cacheprovider",
]


def build(site: Path) -> None:
    """Execute the notebooks and write the site."""
    with tempfile.TemporaryDirectory() as folder:
        executed = Path(folder)
        for notebook in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
            shutil.copy(notebook, executed)
        subprocess.run([sys.executable, *NBMAKE, executed], cwd=executed, check=True)
        subprocess.run(
            [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", site],
            cwd=ROOT,
            env={**os.environ, "QPMPC_EXECUTED_NOTEBOOKS": folder, "NO_MKDOCS_2_WARNING": "1"},
            check=True,
        )


if __name__ == "__main__":
    try:
        build(Path(sys.argv[1]).resolve())
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)
