"""A shared library made by the compiler of this machine, once, and kept."""

import hashlib
import platform
from collections.abc import Callable, Mapping
from pathlib import Path

from qpmpc.codegen.c_compiler import ADVICE, CodegenError, required_compiler, version
from qpmpc.codegen.library_cache import Kept, kept_file
from qpmpc.remarks import say_once


def kept_library(
    files: Mapping[str, str], flags: str, build: Callable[[str, str], bytes], advice: str = ADVICE
) -> Kept:
    """Return the library of some sources, built if it is not there; where it is not kept is said.

    Parameters
    ----------
    files : all that it is made of, by name
    flags : of the compiler
    build : makes its content, of the compiler's command and of what identifies that compiler
    advice : ends the message of an error

    Raises
    ------
    CodegenError
        If there is no compiler, or it fails.
    """
    command = required_compiler()
    try:
        found = Path(command).stat()
        said = version(command, found.st_size, found.st_mtime_ns)
        identity = f"{command, found.st_size, found.st_mtime_ns, platform.machine(), said}"
        kept = kept_file(
            key_of(f"{identity} {flags}", files), ".so", lambda: build(command, identity)
        )
    except OSError as error:
        raise CodegenError(f"no compiled controller: {error}{advice}") from error
    if kept.remark:
        say_once(kept.remark)
    return kept


def key_of(identity: str, files: Mapping[str, str]) -> str:
    """Return the key that a file of these sources is kept by."""
    digest = hashlib.sha256(identity.encode())
    for name, text in files.items():
        digest.update(f"{name}\0{text}\0".encode())
    return digest.hexdigest()[:24]
