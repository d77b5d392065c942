"""Picture of the piecewise-affine (PWA) fits of a vehicle and their errors."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.report.pwa_curves import PwaCurve
from qpmpc.report.style import BLUE, GREY, LIMIT, VERMILION, png, tidy


def draw_pwa(vehicle: str, curves: Sequence[PwaCurve]) -> bytes:
    """Draw each curve with its fit, and below it the error between its proven bounds.

    Returns
    -------
    PNG
    """
    figure = Figure(figsize=(4.0 * len(curves), 5.6), layout="constrained")
    panels = figure.subplots(
        2, len(curves), squeeze=False, sharex="col", gridspec_kw={"height_ratios": [1.5, 1]}
    )
    for i, curve in enumerate(curves):
        _fit(panels[0, i], curve)
        _error(panels[1, i], curve)
    for axes in panels.flat:
        tidy(axes)
    figure.suptitle(f"Piecewise-affine models of {vehicle}", fontsize=11)
    return png(figure)


def _fit(axes: Axes, curve: PwaCurve) -> None:
    x, knots = curve.x / curve.x_unit, curve.fit.breakpoints
    baseline = curve.baseline * curve.x
    axes.plot(x, (curve.y - baseline) / curve.y_unit, color=GREY, linewidth=3, label="curve")
    at_knots = (curve.fit(knots) - curve.baseline * knots) / curve.y_unit
    axes.plot(
        knots / curve.x_unit,
        at_knots,
        "o-",
        color=BLUE,
        linewidth=1.1,
        markersize=3.5,
        label=f"fit, {curve.fit.pieces} pieces",
    )
    axes.set_ylabel(curve.drawn_label or curve.y_label)
    axes.set_title(curve.title, fontsize=9.5)
    axes.legend(frameon=False, fontsize=8)


def _error(axes: Axes, curve: PwaCurve) -> None:
    axes.plot(curve.x / curve.x_unit, curve.error / curve.y_unit, color=VERMILION, linewidth=1.0)
    axes.axhline(curve.fit.above / curve.y_unit, label="proven bounds", **LIMIT)
    axes.axhline(-curve.fit.below / curve.y_unit, **LIMIT)
    axes.set_ylabel(f"fit minus curve {curve.y_unit_name}".strip())
    axes.set_xlabel(curve.x_label)
    axes.margins(y=0.25)
    axes.legend(frameon=False, fontsize=8, loc="lower left", borderaxespad=0.0)
