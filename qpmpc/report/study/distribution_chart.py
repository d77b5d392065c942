"""Distribution of a study's measure as a chart for the page."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qpmpc.report.charts import Panel, Series, dashes, lines, numbers
from qpmpc.report.study.figures import Measure, short
from qpmpc.report.study.pictures import LONGEST, panels_of, styles_of

if TYPE_CHECKING:
    from pandas import DataFrame

SHARES_PERCENT = np.linspace(0.0, 100.0, 201)


def distribution_chart(
    table: "DataFrame", columns: Sequence[str], measure: Measure
) -> dict[str, Any]:
    """Return the value that a share of the runs does not exceed, a line per controller.

    The values are those of runs, none between two of them. A panel per vehicle, as in
    `draw_distribution`.

    Parameters
    ----------
    table : with a value of the measure
    columns : that name a group
    """
    known = table[table[measure.key].notna()]
    panels, groups, styles = [], {}, styles_of(table)
    for title, parts in panels_of(known, columns):
        series = []
        for controller, part in parts:
            style, name = styles[controller], short(controller, LONGEST)
            values = np.quantile(
                part[measure.key].to_numpy(float), SHARES_PERCENT / 100.0, method="inverted_cdf"
            )
            dash = dashes(style["linestyle"])
            series.append(Series(name, numbers(values), style["color"], name, dash, stepped=True))
            groups[name] = series[-1].as_group()
        panels.append(Panel(f"{title}: {measure.heading}", series, height=240))
    return lines(SHARES_PERCENT, "share of the runs, %", "%", panels, list(groups.values()))
