"""Python packages that the installed metadata of qpmpc-iptm names, by extra."""

import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from importlib import metadata
from importlib.util import find_spec

from qpmpc.cli.health.limited import ask
from qpmpc.cli.health.piece import Piece, State

DISTRIBUTION = "qpmpc-iptm"
LIMIT_S = 120.0  # for all imports: a cold disk, not a slow package
SUMS = ("all", "dev", "docs")  # extras that bring no feature: for work on qpmpc itself
DISABLES = {
    "core": "everything",
    "plot": "pictures and HTML reports",
    "verification": "controllers dp and mh-nlp; verify, reproduce, benchmark; rival solvers",
    "sweep": "studies of many runs: sweep, report",
    "logs": "trips from GPX and MDF files",
    "fastsim": "FASTSim's car as the plant",
    "prototype": "C for own terms in cvxpy",
    "a2l": "descriptions for calibration tools: a2l, pil --calibrate",
    "fmu": "checks of an FMU by FMPy; the export itself needs none",
}
# Imports one after the other and says so; a package may print, or end the process
_IMPORTS = """
import importlib, os, sys
said = os.dup(1)
os.dup2(2, 1)
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
        fault = ""
    except BaseException as error:
        fault = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    os.write(said, f"\\n@{name}@{fault}@\\n".encode("utf-8", "replace"))
os._exit(0)
"""
_REQUIREMENT = re.compile(r"^([A-Za-z0-9._-]+)")
_EXTRA = re.compile(r"""extra\s*==\s*["']([\w-]+)["']""")


def requirements() -> dict[str, list[str]]:
    """Return the names of the packages of the core and of each extra."""
    found: dict[str, list[str]] = defaultdict(list)
    try:
        lines = metadata.requires(DISTRIBUTION) or ()
    except metadata.PackageNotFoundError:  # it runs from a folder that nothing was installed from
        return {"core": [DISTRIBUTION]}
    for line in lines:
        name, extra = _REQUIREMENT.match(line), _EXTRA.search(line)
        group = extra[1] if extra else "core"
        if name and group not in SUMS:
            found[group].append(name[1])
    return dict(found)


def packages_found() -> Iterator[Piece]:
    """Yield the state of each package; every one that is there is imported, in another process."""
    groups = requirements()
    versions = {name: _version(name) for names in groups.values() for name in names}
    modules = {name: _module(name) for name, version in versions.items() if version}
    faults = _faults([module for module in modules.values() if module])
    for group, names in groups.items():
        remedy = f"pip install '{DISTRIBUTION}{'' if group == 'core' else f'[{group}]'}'"
        disables = DISABLES.get(group, f"what the extra {group} is for")
        for name in names:
            version, fault = versions[name], faults.get(modules.get(name, ""), "")
            state: State = "missing" if not version else "broken" if fault else "ok"
            found = f"{version}: {fault}" if fault else version
            yield Piece(group, name, state, found, disables, remedy, needed=group == "core")


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _module(name: str) -> str:
    """Return what a package is imported as; empty if that cannot be told."""
    plain = name.lower().replace("-", "_").replace(".", "_")
    if find_spec(plain) is not None:
        return plain
    owners = metadata.packages_distributions()
    mine = [module for module, of in owners.items() if name.lower() in (d.lower() for d in of)]
    return min((each for each in mine if each.isidentifier()), default="", key=len)


def _faults(modules: list[str]) -> dict[str, str]:
    """Return why modules cannot be imported. One that ends the process is left out, and again."""
    faults: dict[str, str] = {}
    left = list(dict.fromkeys(modules))
    while left:
        answer = ask([sys.executable, "-c", _IMPORTS, *left], LIMIT_S)
        said = dict(re.findall(r"^@(.+?)@(.*)@$", answer.text, re.MULTILINE))
        faults |= {name: fault for name, fault in said.items() if fault}
        left = [name for name in left if name not in said]
        if left:  # the first of them is what ended it
            faults[left.pop(0)] = f"its import ends Python: {answer.fault or 'without a word'}"
    return faults
