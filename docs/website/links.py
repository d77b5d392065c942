"""Pages of the repository outside docs/, and links that leave docs/, on the site."""

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
ASSETS = Path(__file__).parent / "assets"
FOLDERS = ["examples"]
# where a page of the repository outside docs/ is on the site; README.md would be taken for an index
RENAMED = {"README.md": "overview.md"}
LINK = re.compile(r"(!?\[[^\]]*\])\(([^)\s]+)\)")
FENCE = re.compile(r"(^```.*?^```$)", re.M | re.S)


def _carried() -> dict[str, str]:
    """Path on the site of each file outside docs/, by its path in the repository."""
    in_folders = [file for folder in FOLDERS for file in sorted((ROOT / folder).iterdir())]
    paths = [str(file.relative_to(ROOT)) for file in in_folders if file.is_file()]
    return RENAMED | {path: path for path in ["CHANGELOG.md", "CONTRIBUTING.md", *paths]}


def on_files(files: Files, config: Any) -> Files:
    """Add what lies outside docs/."""
    for path, on_site in _carried().items():
        files.append(File.generated(config, on_site, abs_src_path=str(ROOT / path)))
    for asset in sorted(ASSETS.iterdir()):
        files.append(File.generated(config, f"website/{asset.name}", abs_src_path=str(asset)))
    return files


def _title(page: str) -> str:
    """Heading of a page, in place of its file's name; the name of any other file."""
    first = (ROOT / page).read_text("utf-8").partition("\n")[0]
    return first.removeprefix("# ") if first.startswith("# ") else posixpath.basename(page)


def rewrite(text: str, page: str) -> str:
    """Let each link between docs/ and the rest lead to where the target is on the site.

    A link to what is not on the site becomes the path of the file in the repository. A page's
    heading takes the place of its file's name.
    """
    carried = _carried()
    sources = {on_site: path for path, on_site in carried.items()}
    folder = posixpath.dirname(sources.get(page, f"docs/{page}"))

    def link(found: re.Match[str]) -> str:
        label, target = found.groups()
        path, mark, anchor = target.partition("#")
        if "://" in target or target.startswith("mailto:") or not path:
            return found.group()
        meant = posixpath.normpath(posixpath.join(folder, path))
        if meant in FOLDERS:
            meant = f"{meant}/README.md"
        if meant.startswith("docs/"):
            on_site = meant.removeprefix("docs/").replace(".ipynb", ".md")
        elif meant in carried:
            on_site = carried[meant]
        else:
            name = label[1:-1].strip("`")
            return f"`{name}`" if name == meant else f"{label[1:-1]} (`{meant}`)"
        if label[1:-1] in (meant, posixpath.basename(meant)):
            label = f"[{_title(meant)}]"
        there = posixpath.relpath(on_site, posixpath.dirname(page) or ".")
        return f"{label}({there}{mark}{anchor})"

    parts = FENCE.split(text)
    return "".join(part if i % 2 else LINK.sub(link, part) for i, part in enumerate(parts))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Mend the links of a page."""
    return rewrite(markdown, page.file.src_uri)
