"""Notebooks as pages: those that build.py has executed, with what they printed and drew."""

import os
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter

SOURCES = Path(__file__).resolve().parents[2] / "docs" / "notebooks"


def on_files(files: Files, config: Any) -> Files:
    """Add a page and its pictures for each notebook."""
    folder = Path(os.environ.get("QPMPC_EXECUTED_NOTEBOOKS", SOURCES))
    for notebook in sorted(folder.glob("*.ipynb")):
        resources = {"output_files_dir": f"{notebook.stem}_files"}
        text, made = MarkdownExporter().from_filename(str(notebook), resources)
        page = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, page, content=text))
        for name, content in made["outputs"].items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files
