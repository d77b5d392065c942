"""HTML pages from templates: every text in them escaped, control characters too.

Reports extend `web/base.html.j2` and take what they share from `web/parts.html.j2`. A page loads
nothing: style and scripts are in it, and its content security policy allows no others.
"""

from base64 import b64encode
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup, escape

from qpmpc.shown import shown


@dataclass(frozen=True)
class Web:
    """Style and scripts of every page, and what the policy knows the scripts by."""

    style: Markup
    script: Markup
    script_hash: str


def html_page(package: str, template: str, **context: Any) -> str:
    """Fill a template.

    Parameters
    ----------
    package, template : where it is
    context : its variables; their text is escaped, see `shown`, but for `preformatted`
    """
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=_printed,
        loader=FunctionLoader(_shared),
    )
    text = files(package).joinpath(template).read_text("utf-8")
    return environment.from_string(text).render(context, web=web())


def preformatted(text: str) -> Markup:
    """Return our own text of several lines for a page: its line ends stay."""
    return escape(text)


@cache
def web() -> Web:
    """Return what is in every page, read once."""
    licence = _shared("uPlot.LICENSE").replace("*/", "")
    chart = f"/* uPlot {licence}*/\n{_library()}\n{_shared('plot.js')}\n{_shared('chart.js')}"
    script = f"{_shared('page.js')}\n{chart}"
    digest = b64encode(sha256(script.encode()).digest()).decode()
    style = _shared("uPlot.min.css") + _shared("page.css")
    return Web(Markup(style), Markup(script), f"sha256-{digest}")


def _library() -> str:
    """Return uPlot without its address: its licence is put before it."""
    return _shared("uPlot.iife.min.js").partition("*/")[2].strip()


def _shared(name: str) -> str:
    return files("qpmpc.report").joinpath("web", name).read_text("utf-8")


def _printed(value: object) -> object:
    return shown(value) if isinstance(value, str) and not isinstance(value, Markup) else value
