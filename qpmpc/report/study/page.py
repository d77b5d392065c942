"""The page of a report: sections of text, tables and pictures; one self-contained file."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from qpmpc.report.html import html_page

Charts = dict[str, Any] | list[dict[str, Any]]


@dataclass(frozen=True)
class Table:
    """Headings and cells; the first `names` columns are left-aligned."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    names: int = 1
    title: str = ""


@dataclass(frozen=True)
class Section:
    """A part of a page, its contents in the order in which they are shown.

    Attributes
    ----------
    pictures : name and PNG, in base64
    texts : heading and text in a fixed-width font
    folded : label and tables that a click opens
    charts : by the names of the pictures that they stand for, see `qpmpc.report.charts`
    """

    title: str = ""
    paragraphs: Sequence[str] = ()
    tables: Sequence[Table] = ()
    remarks: Sequence[str] = ()
    pictures: Sequence[tuple[str, str]] = ()
    texts: Sequence[tuple[str, str]] = ()
    folded: Sequence[tuple[str, Sequence[Table]]] = field(default=())
    charts: Mapping[str, Charts] = field(default_factory=dict)


def page(title: str, answer: Sequence[str], quiet: str, sections: Sequence[Section]) -> str:
    """Return the page; all text is escaped.

    Parameters
    ----------
    answer : what was found, in sentences, the first the most important
    quiet : the line below it
    """
    return html_page(
        "qpmpc.report.study",
        "page.html.j2",
        title=title,
        answer=answer,
        quiet=quiet,
        sections=sections,
    )


def chosen(pictures: Mapping[str, bytes], start: str) -> list[tuple[str, str]]:
    """Return the pictures whose names begin like this, for a `Section`."""
    return [
        (name.replace("_", " "), b64encode(data).decode())
        for name, data in pictures.items()
        if name.startswith(start)
    ]


def table_of(data: Mapping[str, str]) -> Table:
    """Return names and values as a table."""
    return Table(("what", "value"), [(name, text) for name, text in data.items()], names=2)
