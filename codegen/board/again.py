"""A project made again in its folder: what of the earlier one goes, and what the user is told."""

from collections.abc import Container
from pathlib import Path

from qpmpc.codegen.board.manifest import NAME, Manifest, is_as_written, load_manifest
from qpmpc.codegen.generate import MEMORY_KB, Algorithm, Precision, linker_script

LINKER_SCRIPT = "replay.ld"
FLASH_KB = 2048  # of many parts; the user's own is in replay.ld
OF_YOURS = "YOURS: begin and length of\n * the memories of your part."
OF_QEMU = "Of QEMU's board."


def earlier_project(folder: Path) -> Manifest | None:
    """Return what the project in a folder says of itself; None if there is none.

    Raises
    ------
    InputError
        If what is there cannot be read.
    """
    return load_manifest(folder) if (folder / NAME).exists() else None


def memory_map(algorithm: Algorithm, precision: Precision, remark: str) -> str:
    """Return the linker script of a board."""
    return linker_script(algorithm, (FLASH_KB, MEMORY_KB[algorithm, precision][1]), remark)


def is_outgrown(folder: Path, earlier: Manifest, script: str) -> bool:
    """Whether the linker script there is the earlier project's own, unedited, and not `script`."""
    try:
        there = (folder / LINKER_SCRIPT).read_text("utf-8", errors="replace")
    except OSError:  # then it is no file of ours
        return False
    return there == memory_map(earlier.algorithm, earlier.precision, OF_YOURS) != script


def on_edited_script(earlier: Manifest, algorithm: Algorithm, precision: Precision) -> str | None:
    """Return what to say of an edited linker script that is kept; None if it still fits."""
    if (earlier.algorithm, earlier.precision) == (algorithm, precision):
        return None
    return (
        f"{LINKER_SCRIPT} was written for {earlier.algorithm} in {earlier.precision} and edited: "
        f"replay_qemu.ld has what {algorithm} in {precision} needs, "
        f"{MEMORY_KB[algorithm, precision][1]} KB of RAM; take over what differs"
    )


def remove_leftovers(folder: Path, earlier: Manifest, names: Container[str]) -> list[str]:
    """Remove sources of the earlier project that are not among `names`, and as it wrote them.

    Returns
    -------
    what to say of those that were edited, and stay
    """
    remarks = []
    for name, digest in earlier.files.items():
        path = folder / name
        if name in names or not path.is_file():
            continue
        if is_as_written(path, digest):
            path.unlink()
        else:
            remarks.append(
                f"{name} is of the project that was here before, edited, and left: it is no part "
                "of this one"
            )
    return remarks
