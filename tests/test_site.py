"""The site: built strictly, complete, without the network; its notebooks run and are kept clean."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from run_folder import shared_cache

import qpmpc
from qpmpc.cli.app import app

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
EMULATOR = ("arm-none-eabi-gcc", "qemu-system-arm")  # without them one cell says so
# what a browser fetches by itself, unlike the target of a link that a reader clicks
FETCHED = re.compile(r"""<(?:script|img|iframe|source|video)\b[^>]*\bsrc=["']?(https?:)?//""")
STYLES = re.compile(r"""<link\b[^>]*\bhref=["']?(https?:)?//""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "website" / "build.py", folder],
        env={**os.environ, "QPMPC_CACHE_DIR": shared_cache(tmp_path_factory)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    yield folder
    shutil.rmtree(folder)


def text_of(page: Path) -> str:
    """What a reader sees."""
    return re.sub(r"<[^>]+>", "", page.read_text("utf-8"))


@pytest.mark.slow
def test_nothing_is_fetched_from_the_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text("utf-8")
        assert not FETCHED.search(text), page
        assert not STYLES.search(text), page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", sheet.read_text("utf-8")), sheet


@pytest.mark.slow
def test_every_page_is_there_and_refers_to_files_that_are(site: Path) -> None:
    docs = ROOT / "docs"
    for page in docs.rglob("*.md"):
        assert (site / page.relative_to(docs)).with_suffix(".html").exists(), page
    for page in site.rglob("*.html"):
        for target in re.findall(r'(?:src|href)="([^":#?]+)["#?]', page.read_text("utf-8")):
            assert page.name == "404.html" or (page.parent / target).exists(), (page, target)


@pytest.mark.slow
def test_every_public_name_and_command_is_in_the_reference(site: Path) -> None:
    names = (site / "reference.html").read_text("utf-8")
    for name in qpmpc.__all__:
        assert f'id="qpmpc.{name}"' in names, name
    # the one-line entries of our docstrings are read as names, not as types
    text = " ".join(text_of(site / "reference.html").split())
    assert "progress (Progress | None, default: None )" in text
    options = text_of(site / "every_option.html")
    for command in app.registered_commands:
        name = command.name or command.callback.__name__.replace("_", "-")  # type: ignore[union-attr]
        assert f"qpmpc {name} [OPTIONS]" in options, name


@pytest.mark.slow
def test_formulas_are_drawn_by_the_browser_itself(site: Path) -> None:
    page = (site / "mathematics.html").read_text("utf-8")
    assert page.count("<math ") == (ROOT / "docs" / "mathematics.md").read_text().count("```math")
    assert "\\frac" not in page


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_shown_with_what_it_drew(site: Path, notebook: Path) -> None:
    page = (site / "notebooks" / f"{notebook.stem}.html").read_text("utf-8")
    cells = ["".join(cell["source"]) for cell in json.loads(notebook.read_text("utf-8"))["cells"]]
    drawing = [text for text in cells if "plt.show()" in text]
    if not all(map(shutil.which, EMULATOR)):
        drawing = [text for text in drawing if "tools" not in text]
    assert page.count(f'src="{notebook.stem}_files/') == len(drawing) > 0
    assert str(Path.home()) not in text_of(site / "notebooks" / f"{notebook.stem}.html")


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(notebook: Path) -> None:
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


def test_all_three_notebooks_are_there() -> None:
    assert len(NOTEBOOKS) == 3
