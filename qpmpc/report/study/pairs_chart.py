"""Pairs of runs of two studies as charts for the page to draw."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from qpmpc.report.charts import Panel, Series, dashes, groups_of, lines, numbers, only
from qpmpc.report.study.factor_chart import DOT, MOST_DOTS
from qpmpc.report.study.figures import short, value_text
from qpmpc.report.study.pictures import LONGEST
from qpmpc.report.style import BLACK, line_style

SHARES_PERCENT = np.linspace(0.0, 100.0, 201)


def pairs_charts(
    shown: Sequence[Mapping[str, Any]], kind: str, sides: tuple[str, str], what: str, title: str
) -> list[dict[str, Any]]:
    """Return B over A, a dot for each pair, and the sorted differences.

    Of more than `MOST_DOTS` pairs of a controller, every other, third ... by its difference is a
    dot, which is said.

    Parameters
    ----------
    shown : pairs with all of these figures
    kind : key of the difference; `title` names it
    sides : keys of A and B; `what` names them
    """
    names = list(dict.fromkeys(pair["controller"] for pair in shown))
    styles = {name: line_style(name, i) for i, name in enumerate(names)}
    by_name = {
        name: sorted((p for p in shown if p["controller"] == name), key=lambda p: p[kind])
        for name in names
    }
    step = max(-(-len(own) // MOST_DOTS) for own in by_name.values())
    dots = [pair for own in by_name.values() for pair in own[::step]]
    dots.sort(key=lambda pair: pair[sides[0]])
    a, b = ([pair[side] for pair in dots] for side in sides)
    left_out = "" if step == 1 else f" (a dot for one of {step} pairs)"
    scatter = Panel(
        f"B: {what}{left_out}; on the line both are equal",
        [
            Series("equal", numbers(a), BLACK, aside=True),
            *(
                Series(
                    short(name, LONGEST),
                    only(b, [pair["controller"] == name for pair in dots]),
                    styles[name]["color"],
                    short(name, LONGEST),
                    points=True,
                    size=DOT,
                )
                for name in names
            ),
        ],
        height=340,
        labels=[
            f"runs {pair['run_a']}, {pair['run_b']}, {short(value_text(pair['cycle']), LONGEST)}, "
            f"{short(pair['controller'], LONGEST)}: A {x:.4g}, B {y:.4g}"
            for pair, x, y in zip(dots, a, b, strict=True)
        ],
    )
    ranked = Panel(
        title,
        [
            Series(
                short(name, LONGEST),
                numbers(
                    np.quantile(
                        [pair[kind] for pair in own], SHARES_PERCENT / 100.0, method="inverted_cdf"
                    )
                ),
                styles[name]["color"],
                short(name, LONGEST),
                dashes(styles[name]["linestyle"]),
                stepped=True,
            )
            for name, own in by_name.items()
        ],
        height=240,
        zero=True,
    )
    return [
        lines(a, f"A: {what}", "", [scatter], groups_of([scatter])),
        lines(SHARES_PERCENT, "share of the pairs, %", "%", [ranked], groups_of([ranked])),
    ]
