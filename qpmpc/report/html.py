"""HTML pages from templates: every text in them escaped, control characters too."""

from importlib.resources import files
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape

from qpmpc.shown import shown


def html_page(package: str, template: str, **context: Any) -> str:
    """Fill a template.

    Parameters
    ----------
    package, template : where it is
    context : its variables; their text is escaped, see `shown`, but for `preformatted`
    """
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, finalize=_printed
    )
    text = files(package).joinpath(template).read_text("utf-8")
    return environment.from_string(text).render(context)


def preformatted(text: str) -> Markup:
    """Return our own text of several lines for a page: its line ends stay."""
    return escape(text)


def _printed(value: object) -> object:
    return shown(value) if isinstance(value, str) and not isinstance(value, Markup) else value
