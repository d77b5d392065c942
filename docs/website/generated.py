"""Reference pages: public names from their docstrings, all options of the command from its help."""

import importlib
import inspect
import re
import shutil
from pathlib import Path
from typing import Any

import typer
from mkdocs.structure.files import File, Files
from typer.cli import get_docs_for_click

from qpmpc.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
NAME = re.compile(r"^\| `([\w.]+)` \|", re.MULTILINE)
MARKUP = re.compile(r"\[(b|dim)\](.*?)\[/\1\]")
LIST = re.compile(r"^\*\*Commands\*\*:\n\n(\*.*\n)+\n", re.MULTILINE)
EXAMPLE = re.compile(r"^  (qpmpc .*)$", re.MULTILINE)


def on_startup(**_: Any) -> None:
    """Put all packages where they are imported from: griffe follows no hooks and no links."""
    tree = ROOT / "build" / "docstrings"
    shutil.rmtree(tree, ignore_errors=True)
    for name in ("qpmpc", "qpmpc.codegen", "qpmpc.cycles", "qpmpc.verification"):
        folder = Path(inspect.getfile(importlib.import_module(name))).parent
        for source in folder.rglob("*.py"):
            copy = tree.joinpath(*name.split(".")) / source.relative_to(folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)


def every_option() -> str:
    """Help of all commands as a page."""
    command = typer.main.get_command(app)
    context = typer.Context(command, info_name="qpmpc")
    text = get_docs_for_click(obj=command, ctx=context, name="qpmpc")
    text = MARKUP.sub(lambda found: f"`{found[2]}`" if found[1] == "b" else found[2], text)
    text = EXAMPLE.sub(r"    \1", text)
    text = LIST.sub("", text)  # its lines are cut short, and the headings say the same
    return text.replace("# `qpmpc`", "# Every option", 1)


def on_files(files: Files, config: Any) -> Files:
    """Add the page of options."""
    files.append(File.generated(config, "every_option.md", content=every_option()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Append the docstring of each name in the tables of reference.md; room on the front page."""
    if page.file.src_uri == "index.md":
        page.meta["hide"] = ["navigation", "toc"]
    if page.file.src_uri != "reference.md":
        return markdown
    names = NAME.findall(markdown)
    entries = "\n\n".join(f"::: {name}" for name in names)
    linked = NAME.sub(r"| [`\1`][\1] |", markdown)
    return f"{linked}\n\n## From the docstrings\n\n{entries}\n"
