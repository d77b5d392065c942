"""Style of all pictures: colours that colour-blind readers can tell apart."""

import warnings
from io import BytesIO
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, NullFormatter

from qpmpc.shown import is_plain, shown

# Okabe and Ito, "Color Universal Design" (2008): safe with all common colour deficiencies.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, YELLOW = "#0072B2", "#D55E00", "#CC79A7", "#C9B800"  # darkened
GREY = "#777777"

# A controller has the same colour and dashes in every picture; others take the spare ones.
CONTROLLER_STYLES = {
    "mh-qp": (VERMILION, "-"),
    "mh-qp-paper": (SKY, "-"),
    "rule-based": (GREY, "-"),
    "dp": (BLACK, (0, (4, 2))),
    "baseline-mpc": (GREEN, "-"),
    "ecms": (ORANGE, "-"),
    "mh-nlp": (PURPLE, (0, (4, 2))),
    "mh-costate": (BLUE, (0, (4, 2))),
}
SPARE_STYLES = ((BLUE, "-"), (YELLOW, "-"), (BLUE, (0, (1, 1))), (YELLOW, (0, (1, 1))))
LIMIT: dict[str, Any] = {"color": "#AA0000", "linewidth": 0.8, "linestyle": (0, (1, 2))}
FAULT: dict[str, Any] = {"color": PURPLE, "alpha": 0.3, "linewidth": 0.0}

DPI = 110


def line_style(controller: str, index: int = 0) -> dict[str, Any]:
    """Return matplotlib's keywords for the line of a controller."""
    spare = SPARE_STYLES[index % len(SPARE_STYLES)]
    color, dashes = CONTROLLER_STYLES.get(controller, spare)
    return {"color": color, "linestyle": dashes, "linewidth": 1.2}


def tidy(axes: Axes) -> None:
    """Remove parts that carry no information."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    axes.yaxis.label.set_fontsize(8.5)
    axes.xaxis.label.set_fontsize(8.5)


def log_scale(axes: Axes, x: bool = False, y: bool = False) -> None:
    """Make axes logarithmic, their decades written as plain numbers: powers would be formulas."""
    for wanted, scale, axis in (
        (x, axes.set_xscale, axes.xaxis),
        (y, axes.set_yscale, axes.yaxis),
    ):
        if wanted:
            scale("log")
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())


def as_plain_text(figure: Figure) -> None:
    """Take all text of a figure as it is: no formulas, control characters escaped."""
    for text in figure.findobj(Text):
        text.set_parse_math(False)
        lines = text.get_text().split("\n")
        if not all(map(is_plain, lines)):
            text.set_text("\n".join(map(shown, lines)))


def png(figure: Figure) -> bytes:
    """Render as PNG, without the date, so that equal results make equal files."""
    as_plain_text(figure)
    buffer = BytesIO()
    with warnings.catch_warnings():
        # names in a script that the font lacks are drawn as boxes
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()
