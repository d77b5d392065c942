"""Folders that the package writes to."""

from collections.abc import Callable, Iterator
from pathlib import Path

from qpmpc.cli.health.piece import Piece
from qpmpc.errors import InputError
from qpmpc.files import check_folder

RESULTS = Path("results")


def folders_found() -> Iterator[Piece]:
    """Yield the state of both caches and of the folder that examples write to."""
    yield _piece(
        "compiled controllers",
        _compiled,
        "each run compiles again, one to two seconds",
        "QPMPC_CACHE_DIR=FOLDER",
    )
    yield _piece(
        "dynamic programming",
        _optima,
        "each optimum is computed again",
        "QPMPC_CACHE_DIR=FOLDER",
    )
    yield _piece("results", _results, "the default of --out cannot be written", "--out FOLDER")


def _piece(name: str, look: Callable[[], tuple[Path, str]], disables: str, remedy: str) -> Piece:
    try:
        folder, fault = look()
    except Exception as error:  # numpy, say, is broken
        folder, fault = Path(), f"{type(error).__name__}: {error}"
    found = f"{folder}: {fault}" if fault else str(folder)
    return Piece("folders", name, "broken" if fault else "ok", found, disables, remedy)


def _compiled() -> tuple[Path, str]:
    from qpmpc.codegen.library_cache import folder_and_fault

    return folder_and_fault()


def _optima() -> tuple[Path, str]:
    from qpmpc.verification.dynamic_programming.cache import folder

    return _writable(folder())


def _results() -> tuple[Path, str]:
    return _writable(Path.cwd() / RESULTS)


def _writable(folder: Path) -> tuple[Path, str]:
    try:
        check_folder(folder, "")
    except InputError as error:
        return folder, str(error).removeprefix(f" {folder}: ")
    return folder, ""
