"""Figures of the reproduction as charts for the page to draw: bars, losses, distances."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.report.charts import Panel, Series, groups_of, in_rows, lines, numbers, only
from qpmpc.report.style import BLACK, GREY, PURPLE, VERMILION
from qpmpc.verification.reproduction import paper
from qpmpc.verification.reproduction.drawing import color
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.tables import printed_name
from qpmpc.verification.reproduction.variants import RULES

SPREAD = 0.25  # of the dots of a row, in rows
TRIP, BROKEN, MEAN = "a trip", "a trip that violates a limit", "mean of its kind"
KINDS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    (TRIP, VERMILION, {"points": True, "size": 6}),
    (BROKEN, PURPLE, {"points": True, "hollow": True}),
    (MEAN, BLACK, {"points": True, "hollow": True, "size": 11}),
)


def bars_chart(study: Study, labels: Sequence[str]) -> dict[str, Any]:
    """Return fuel and time per step of variants, on each of the paper's cycles."""
    panels = []
    for cycle in (each.name for each in study.extent.cycles):
        rows = [study.rows[cycle, label] for label in labels]
        fuel = [row["fuel_soc_balanced_g"] for row in rows]
        own = _one_each(fuel, labels, bars=True)
        said = [_fuel_text(study, cycle, label) for label in labels]
        short = [
            f"{row['fuel_soc_balanced_g']:.1f} g"
            + (f", {-row['saving_vs_rule_percent']:+.1f} %" if label != RULES else "")
            for label, row in zip(labels, rows, strict=True)
        ]
        panels.append(
            Panel(
                f"{cycle}: SOC-balanced fuel, g, and its difference from the rules",
                own,
                zero=True,
                labels=[f"{label}: {text}" for label, text in zip(labels, said, strict=True)],
                texts=short,
            )
        )
        panels.append(_times(cycle, labels, [row["step_time_ms"]["mean"] for row in rows]))
    return in_rows(labels, panels, groups_of(panels))


def _one_each(values: Sequence[float], labels: Sequence[str], **look: Any) -> list[Series]:
    """Return a series of one value for each variant, in its colour."""
    return [
        Series(label, only(values, [label == each for each in labels]), color(label), label, **look)
        for label in labels
    ]


def _fuel_text(study: Study, cycle: str, label: str) -> str:
    row = study.rows[cycle, label]
    printed = paper.SAVING_PERCENT.get((cycle, printed_name(label)))
    text = f"{row['fuel_soc_balanced_g']:.1f} g"
    saving = row["saving_vs_rule_percent"]
    if label != RULES:
        text += f", {abs(saving):.1f} % {'less' if saving > 0.0 else 'more'} than the rules"
    return text + (f" (paper {printed:.1f} %)" if printed is not None else "")


def _times(cycle: str, labels: Sequence[str], mean_ms: Sequence[float | None]) -> Panel:
    ours = [value if value else np.nan for value in mean_ms]
    printed = [paper.STEP_TIME_S.get(printed_name(label)) for label in labels]
    theirs = [np.nan if value is None else 1e3 * value for value in printed]
    said = []
    for label, mine, other in zip(labels, ours, theirs, strict=True):
        parts = [f"{mine:.2g} ms"] if np.isfinite(mine) else []
        parts += [f"the paper's {other:.2g} ms"] if np.isfinite(other) else []
        said.append(f"{label}: {', '.join(parts) or 'no time'}")
    return Panel(
        f"{cycle}: mean time per step, ms (hollow: the paper's)",
        [
            *_one_each(ours, labels, points=True),
            Series("the paper's", numbers(theirs), GREY, "the paper's", points=True, hollow=True),
        ],
        log=True,
        labels=said,
    )


def losses_chart(study: Study) -> dict[str, Any]:
    """Return the losses with wrong forecasts, a dot for each trip and a row for each kind."""
    models = list(dict.fromkeys(run.model for run in study.forecasts))
    panels = []
    for cycle in study.optima:
        runs = [run for run in study.forecasts if run.cycle == cycle]
        places = np.array([models.index(run.model) for run in runs], dtype=float)
        for i in range(len(models)):
            own = places == i
            places[own] += np.linspace(-SPREAD, SPREAD, own.sum()) if own.sum() > 1 else 0.0
        marks = [
            (
                place,
                run.loss_percent,
                BROKEN if run.violates else TRIP,
                f"{run.model}, seed {run.seed}: {run.loss_percent:+.2f} %"
                + (", a limit violated" if run.violates else ""),
            )
            for place, run in zip(places.tolist(), runs, strict=True)
        ]
        for i, model in enumerate(models):
            mean = float(np.mean([run.loss_percent for run in runs if run.model == model]))
            marks.append((float(i), mean, MEAN, f"{model}: {mean:+.2f} % in the mean"))
        marks.sort(key=lambda mark: mark[0])
        loss = [value for _, value, _, _ in marks]
        dots = [
            Series(name, only(loss, [kind == name for _, _, kind, _ in marks]), color, name, **look)
            for name, color, look in KINDS
        ]
        bad = sum(run.violates for run in runs)
        panels.append(
            Panel(
                f"{cycle}: loss of fuel, % ({bad} of {len(runs)} violate a limit)",
                dots,
                zero=True,
                x=numbers([place for place, _, _, _ in marks]),
                labels=[said for _, _, _, said in marks],
            )
        )
    return in_rows(models, panels, groups_of(panels))


def distances_chart(study: Study, labels: Sequence[str], marked: str) -> dict[str, Any]:
    """Return fuel above DP, a row for each cycle; `marked` is larger."""
    cycles = list(study.optima)
    points = sorted(
        (i + 0.1 * (k - (len(labels) - 1) / 2), cycle, label)
        for i, cycle in enumerate(cycles)
        for k, label in enumerate(labels)
    )
    above = [study.rows[cycle, label]["fuel_above_dp_percent"] for _, cycle, label in points]
    series = [
        Series(
            label,
            only(above, [each == label for _, _, each in points]),
            color(label),
            label,
            points=True,
            size=11 if label == marked else 8,
        )
        for label in labels
    ]
    said = [
        f"{label} on {cycle}: {v:+.2f} %"
        for v, (_, cycle, label) in zip(above, points, strict=True)
    ]
    panel = Panel(
        "SOC-balanced fuel above dynamic programming, %",
        series,
        zero=True,
        x=numbers([place for place, _, _ in points]),
        labels=said,
    )
    return in_rows(cycles, [panel], groups_of([panel]))


def alpha_chart(
    temperature: NDArray[np.float64], curves: dict[str, NDArray[np.float64]]
) -> dict[str, Any]:
    """Return the fuel multiplier over coolant temperature; the first curve is ours."""
    series = [
        Series(name, numbers(values), VERMILION if i == 0 else GREY, name, dash=[6, 4] if i else [])
        for i, (name, values) in enumerate(curves.items())
    ]
    panel = Panel("alpha, fuel cold over hot", series, height=260)
    return lines(temperature, "coolant, °C", "°C", [panel], groups_of([panel]))
