"""Compilers and other commands: found, run with a time limit, and asked for their version."""

import os
import re
import shutil
from collections.abc import Iterator
from typing import NamedTuple

from qpmpc.cli.health.limited import ask
from qpmpc.cli.health.piece import Piece

LIMIT_S = 10.0  # for an answer; an emulated or networked tool is slow, a hanging one never ends
LONGEST = 80  # characters of an answer that are shown


class _Tool(NamedTuple):
    """Names that a tool may have, Debian's packages of it, and what needs it."""

    names: tuple[str, ...]
    packages: str
    disables: str
    includes: bool = False  # it must find the headers of the C library too


_TOOLS = (
    _Tool(
        (*filter(None, [os.environ.get("CC", "")]), "cc", "gcc", "clang"),
        "gcc libc6-dev",
        "generated controllers run in Python, steps take several times longer",
        includes=True,
    ),
    _Tool(("make",), "make", "generated C projects are not built: qpmpc pil"),
    _Tool(
        ("arm-none-eabi-gcc",),
        "gcc-arm-none-eabi libnewlib-arm-none-eabi",
        "no firmware: qpmpc pil, projects of qpmpc codegen --target cortex-m7",
        includes=True,
    ),
    _Tool(("qemu-system-arm",), "qemu-system-arm", "no emulated Cortex-M7: qpmpc pil"),
    _Tool(("cppcheck",), "cppcheck", "only tests: the MISRA rules of the generated C"),
    _Tool(("valgrind",), "valgrind", "only tests: instructions of the generated C on the host"),
    _Tool(
        ("chromium", "chromium-browser", "google-chrome"),
        "chromium",
        "only tests: reports in a browser",
    ),
)


def tools_found() -> Iterator[Piece]:
    """Yield the state of each tool."""
    for tool in _TOOLS:
        yield _piece(tool)


def _piece(tool: _Tool) -> Piece:
    path = next((found for name in tool.names if (found := shutil.which(name))), None)
    remedy = f"apt-get install {tool.packages}"
    if path is None:
        return Piece("tools", tool.names[-1], "missing", "", tool.disables, remedy)
    answer = ask([path, "--version"], LIMIT_S)
    fault = answer.fault
    if not fault and tool.includes:
        # not -E: how long the headers are depends on the C library, and newer ones pass 64 KB
        source = b"#include <math.h>\n#include <string.h>\n"
        tried = ask([path, "-fsyntax-only", "-x", "c", "-"], LIMIT_S, source)
        if tried.fault:
            wrong = [line for line in tried.text.splitlines() if "error" in line]
            fault = _short(wrong[0]) if wrong else tried.fault
    found = f"{path}: {fault}" if fault else f"{_version(answer.text)} ({path})"
    name = os.path.basename(path)  # noqa: PTH119 - of a text
    return Piece("tools", name, "broken" if fault else "ok", found, tool.disables, remedy)


def _version(text: str) -> str:
    """Return the version number in an answer."""
    number = re.search(r"(?<![\w.])\d+\.\d+[\d.]*(?![\w.])", re.sub(r"\(.*?\)", "", text))
    return number[0] if number else "no version"


def _short(line: str) -> str:
    line = line.strip()
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."
