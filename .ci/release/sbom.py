"""List what is shipped and what it needs, with licences, as CycloneDX 1.6 (JSON).

``make sbom`` writes build/sbom.cdx.json. Packages, versions and licences are what the metadata of
this environment says, required ones apart from those of extras; `dev` and `docs` are left out. The
cycles' data, uPlot in the reports, and OSQP, whose sources ``qpmpc codegen --algorithm osqp``
copies into projects, are components too.
The same environment gives the same file: it has no date and no random number.
"""

import json
import re
import sys
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from qpmpc.cycles.catalogue import catalogue

PRODUCT = "qpmpc-iptm"
LEFT_OUT = ("all", "dev", "docs")
LONGEST = 80  # characters of a licence's name; some packages give its whole text


def requirements(name: str, extras: tuple[str, ...]) -> list[Requirement]:
    """Return what a package with these extras requires on this machine."""
    found = [Requirement(line) for line in metadata.requires(name) or ()]
    return [
        each
        for each in found
        if each.marker is None or any(each.marker.evaluate({"extra": e}) for e in ("", *extras))
    ]


def closure(extras: tuple[str, ...]) -> dict[str, set[str]]:
    """Return each installed package that the product with these extras needs, and its needs."""
    graph: dict[str, set[str]] = {}
    left = [(PRODUCT, extras)]
    seen: set[tuple[str, tuple[str, ...]]] = set()
    while left:
        name, of = left.pop()
        if (name, of) in seen:
            continue
        seen.add((name, of))
        needs = graph.setdefault(name, set())
        for each in requirements(name, of):
            other = normal(each.name)
            if is_installed(other):
                needs.add(other)
                left.append((other, tuple(sorted(each.extras))))
    return graph


def normal(name: str) -> str:
    """Return a name as PyPI's addresses have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def is_installed(name: str) -> bool:
    """Whether this environment has a package."""
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def licences(name: str) -> list[dict[str, Any]]:
    """Return the licence that a package's metadata states, as CycloneDX has it."""
    said = metadata.metadata(name)
    if expression := said.get("License-Expression"):
        return [{"expression": expression}]
    classes = [
        line.rpartition(" :: ")[2]
        for line in said.get_all("Classifier") or ()
        if line.startswith("License ::") and not line.endswith(":: OSI Approved")
    ]
    text = next(
        (line.strip() for line in (said.get("License") or "").splitlines() if line.strip()), ""
    )
    names = classes or [text[:LONGEST]]
    if names in (["Other/Proprietary License"], [""]):  # then its licence file knows better
        names = [file_title(name) or "not stated in its metadata"]
    return [{"license": {"name": each}} for each in names]


def file_title(name: str) -> str:
    """Return how the first licence file of a package begins; empty if it has none."""
    files = metadata.files(name) or ()
    for file in sorted(file for file in files if ".dist-info" in str(file.parent)):
        if file.name.upper().startswith(("LICENSE", "LICENCE", "COPYING")):
            lines = [line.strip() for line in file.read_text("utf-8").splitlines()]
            return ", ".join([line for line in lines if line][:2])[:LONGEST]
    return ""


def reference(name: str) -> str:
    """Return the package's URL (purl)."""
    return f"pkg:pypi/{name}@{metadata.version(name)}"


def package(name: str, required: bool) -> dict[str, Any]:
    """Return the component of an installed package."""
    component = {
        "type": "library",
        "bom-ref": reference(name),
        "name": name,
        "version": metadata.version(name),
        "purl": reference(name),
        "licenses": licences(name),
        "scope": "required" if required else "optional",
    }
    if name == "osqp":
        where = "qpmpc codegen --algorithm osqp copies its C sources, with QDLDL, and LICENSE"
        component["properties"] = [
            {"name": f"{PRODUCT}:copied-into-generated-code", "value": where}
        ]
    return component


def data() -> list[dict[str, Any]]:
    """Return a component for each shipped cycle."""
    return [
        {
            "type": "data",
            "bom-ref": f"cycle:{entry.name}",
            "name": f"cycle {entry.name}",
            "description": f"{entry.title}. Source: {entry.source}",
            "licenses": [{"license": {"name": entry.licence}}],
        }
        for entry in catalogue()
    ]


def chart_library() -> dict[str, Any]:
    """Return the component of uPlot, which is in the package itself and in every report."""
    program = files("qpmpc.report").joinpath("web", "uPlot.iife.min.js").read_text("utf-8")
    found = re.search(r"uPlot \(v([\d.]+)\)", program)
    assert found, "uPlot's first line names its version"
    url = f"pkg:npm/uplot@{found[1]}"
    return {
        "type": "library",
        "bom-ref": url,
        "name": "uplot",
        "version": found[1],
        "purl": url,
        "licenses": [{"license": {"name": "MIT"}}],
        "scope": "required",
    }


def bill() -> dict[str, Any]:
    """Return the whole bill of materials."""
    offered = metadata.metadata(PRODUCT).get_all("Provides-Extra") or []
    extras = tuple(sorted(extra for extra in offered if extra not in LEFT_OUT))
    graph = closure(extras)
    required = closure(()).keys()
    shipped = [*data(), chart_library()]
    others = sorted(graph.keys() - {PRODUCT})
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": reference(PRODUCT),
                "name": PRODUCT,
                "version": metadata.version(PRODUCT),
                "purl": reference(PRODUCT),
                "licenses": licences(PRODUCT),
            }
        },
        "components": [*(package(name, name in required) for name in others), *shipped],
        "dependencies": [
            {
                "ref": reference(name),
                "dependsOn": sorted(map(reference, needs))
                + ([each["bom-ref"] for each in shipped] if name == PRODUCT else []),
            }
            for name, needs in sorted(graph.items())
        ],
    }


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.parent.mkdir(parents=True, exist_ok=True)
    made = bill()
    target.write_text(json.dumps(made, indent=1) + "\n", "utf-8")
    print(f"{target}: {len(made['components'])} components")
