"""The C compiler of this machine, and a generated project compiled by it into a shared library.

All numbers of a vehicle are in one file, `DATA`. The others depend on sizes and constants only:
they are compiled into one relocatable object, with which that file is linked.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from qpmpc.errors import QpmpcError

# no number depends on these; without the latter two gcc makes no vectors of loops with choices
ARITHMETIC = "-ffp-contract=off -fno-math-errno -fno-trapping-math"
# -w: a new compiler's warnings must not stop a user; the tests check warnings
COMPILE = f"-O3 -std=c99 -w {ARITHMETIC} -fPIC -Iosqp -Iosqp/inc/public -Iosqp/inc/private"
# of several loaded libraries each must call its own functions; macOS has it so by itself
OWN_FUNCTIONS = "" if sys.platform == "darwin" else " -Wl,-Bsymbolic"
FLAGS = f"{COMPILE} -shared{OWN_FUNCTIONS}"
RELOCATABLE = f"{COMPILE} -r -nostdlib"
DATA = "mpc_data.c"
NEEDS_NONE = "mh_qp.implementation=python needs none"
ADVICE = f"; {NEEDS_NONE}"


class CodegenError(QpmpcError):
    """A generated controller could not be built or does not fit its caller."""


def compiler() -> str | None:
    """Return the C compiler of this machine: $CC, cc, gcc or clang; None if there is none."""
    names = [os.environ.get("CC", ""), "cc", "gcc", "clang"]
    return next((found for name in names if name and (found := shutil.which(name))), None)


def required_compiler(without: str = "no C compiler found") -> str:
    """Return the C compiler of this machine.

    Parameters
    ----------
    without : begins the message if there is none

    Raises
    ------
    CodegenError
        If there is none.
    """
    command = compiler()
    if command is None:
        raise CodegenError(f"{without} (tried $CC, cc, gcc, clang)")
    return command


@cache
def version(command: str, size: int, modified_ns: int) -> bytes:
    """Return what a compiler says of itself; its file may be a wrapper that stays the same."""
    return subprocess.run([command, "--version"], capture_output=True, check=False).stdout


def library_of(
    command: str, files: Mapping[str, str], common: Path | None = None, hidden: bool = False
) -> bytes:
    """Return the content of the shared library of all sources, by name.

    Parameters
    ----------
    common : object made by `common_object`; only `DATA` is then compiled
    hidden : whether only what the sources mark as exported is visible outside, as in an FMU

    Raises
    ------
    CodegenError
        If the compiler fails.
    """
    objects = [] if common is None else [str(common)]
    sources = _sources(files) if common is None else [DATA]
    visible = ["-fvisibility=hidden"] if hidden else []
    advice = "" if hidden else ADVICE
    return made_by(command, files, [*FLAGS.split(), *visible, *objects, *sources, "-lm"], advice)


def common_object(command: str, files: Mapping[str, str]) -> bytes:
    """Return the content of the relocatable object of all sources but `DATA`.

    Raises
    ------
    CodegenError
        If the compiler fails.
    """
    sources = [name for name in _sources(files) if name != DATA]
    return made_by(command, files, [*RELOCATABLE.split(), *sources])


def _sources(files: Mapping[str, str]) -> list[str]:
    return sorted(name for name in files if name.endswith(".c"))


def made_by(
    command: str, files: Mapping[str, str], arguments: list[str], advice: str = ADVICE
) -> bytes:
    """Write what the sources among the arguments may need, compile, and return what was made.

    Parameters
    ----------
    files : by name; headers, and those that the arguments name, are written
    arguments : of the compiler, without the name of what it makes
    advice : ends the message of an error

    Raises
    ------
    CodegenError
        If the compiler fails, or cannot be run.
    """
    try:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            for name, text in files.items():
                if name.endswith(".h") or name in arguments:
                    (folder / name).parent.mkdir(parents=True, exist_ok=True)
                    (folder / name).write_text(text, "utf-8")
            result = subprocess.run(
                [command, "-o", "made", *arguments],
                cwd=folder,
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
            )
            made = folder / "made"
            content = made.read_bytes() if made.exists() and not result.returncode else b""
    except OSError as error:
        raise CodegenError(f"C compiler {command} cannot be run: {error}{advice}") from error
    if not content:
        first = next(iter(result.stderr.strip().splitlines()), "no library was built")
        raise CodegenError(f"C compiler {command} failed: {first}{advice}")
    return content
