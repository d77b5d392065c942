"""The house rules of imports, held on the tree as it is imported: every import statement counts,
those inside functions too, and every name of the registry and of the public face."""

import ast
import re
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

import qpmpc
from qpmpc.names import Names, Shipped
from qpmpc.registry import TABLES

ROOT = Path(__file__).parents[1]
FOLDERS = {
    "qpmpc": ROOT / "qpmpc",
    "qpmpc.codegen": ROOT / "codegen",
    "qpmpc.cycles": ROOT / "cycles",
    "qpmpc.verification": ROOT / "verification",
}
UPPER = ("qpmpc.codegen", "qpmpc.verification")  # which know qpmpc and are not known by it, but:
MAY_KNOW_UPPER = ("qpmpc.registry", "qpmpc.cli")


def modules() -> dict[str, Path]:
    found = {}
    for package, folder in FOLDERS.items():
        for file in folder.rglob("*.py"):
            parts = file.relative_to(folder).with_suffix("").parts
            found[".".join([package, *(p for p in parts if p != "__init__")])] = file
    return found


MODULES = modules()


def imported(tree: ast.Module) -> Iterator[str]:
    """Modules that a module imports, wherever it does so; what only type checkers read is left
    out."""
    skipped = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else node.module


def edges() -> dict[str, set[str]]:
    graph = {
        name: {other for other in imported(ast.parse(file.read_text("utf-8"))) if other in MODULES}
        for name, file in MODULES.items()
    }
    for table in TABLES:
        for entry in table.shipped.values():
            owner = "qpmpc.solvers.names" if table.kind == "solver" else "qpmpc.registry"
            for target in (entry.target, entry.settings):
                if ":" in target:
                    graph[owner].add(target.partition(":")[0])
    graph["qpmpc"] |= {f"qpmpc.{home}" for home in qpmpc._HOME.values()}
    return graph


GRAPH = edges()


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected components of more than one node (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            component = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(component) > 1:
                found.append(sorted(component))

    for node in graph:
        if node not in index:
            visit(node)
    return found


def folder_of(module: str) -> str:
    """The folder that a module belongs to; single modules on the top stand for themselves."""
    parts = module.split(".")
    depth = 3 if parts[1:2] == ["verification"] else 2
    return ".".join(parts[:depth])


def test_the_circle_finder_finds_circles() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert circles(graph) == [["b", "c"]]


def test_no_circle_of_modules() -> None:
    assert circles(GRAPH) == []


def test_no_circle_of_folders() -> None:
    folders: dict[str, set[str]] = {folder_of(module): set() for module in MODULES}
    for module, others in GRAPH.items():
        folders[folder_of(module)] |= {folder_of(o) for o in others} - {folder_of(module)}
    assert circles(folders) == []


def test_the_core_knows_codegen_and_verification_in_two_places_only() -> None:
    offenders = [
        f"{module} imports {other}"
        for module, others in GRAPH.items()
        for other in others
        if not module.startswith(UPPER)
        and other.startswith(UPPER)
        and not module.startswith(MAY_KNOW_UPPER)
    ]
    assert offenders == []


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.kind)
def test_every_shipped_name_leads_somewhere(table: Names) -> None:
    for name, entry in table.shipped.items():
        for target in (entry.target, entry.settings):
            module, _, attribute = target.partition(":")
            if not attribute or (entry.module and find_spec(entry.module) is None):
                continue
            path = MODULES[module]
            defined = {
                node.name
                for node in ast.walk(ast.parse(path.read_text("utf-8")))
                if isinstance(node, ast.ClassDef | ast.FunctionDef)
            }
            assigned = {
                target.id
                for node in ast.walk(ast.parse(path.read_text("utf-8")))
                if isinstance(node, ast.Assign)
                for target in node.targets
                if isinstance(target, ast.Name)
            }
            assert attribute in defined | assigned, f"{table.kind} {name}: {target}"


def test_what_escapes_text_is_not_passed_by() -> None:
    """Pages, tables and the console of the command line are made in one place each."""
    users: dict[str, set[str]] = {"jinja2": set(), "rich.table": set()}
    for name, file in MODULES.items():
        for other in imported(ast.parse(file.read_text("utf-8"))):
            if other in users:
                users[other].add(name)
    assert users == {
        "jinja2": {"qpmpc.report.html", "qpmpc.codegen.generate"},
        "rich.table": {"qpmpc.report.table"},
    }
    for package in FOLDERS.values():
        for template in package.rglob("*.html.j2"):
            words = re.findall(r"\w+", template.read_text("utf-8"))
            assert not {"safe", "autoescape"} & set(words), template


def test_a_wrong_target_would_be_noticed() -> None:
    table = Names("thing", {"a": Shipped("qpmpc.registry:no_such_name")})
    with pytest.raises(AssertionError, match="no_such_name"):
        test_every_shipped_name_leads_somewhere(table)


def test_folders_of_verification_import_only_from_those_above_them() -> None:
    """In the order of the table in their README."""
    folder = FOLDERS["qpmpc.verification"]
    lines = (folder / "README.md").read_text("utf-8").splitlines()
    order = [line.split("`")[1].rstrip("/") for line in lines if line.startswith("| `")]
    assert sorted(order) == sorted(
        inner.name for inner in folder.iterdir() if (inner / "__init__.py").exists()
    )
    prefix = "qpmpc.verification."
    for name, others in GRAPH.items():
        if not name.startswith(prefix):
            continue
        place = order.index(name.removeprefix(prefix).partition(".")[0])
        for other in others:
            if other.startswith(prefix):
                assert order.index(other.removeprefix(prefix).partition(".")[0]) <= place, (
                    f"{name} imports {other}"
                )
