"""Picture of a board's log; it needs matplotlib."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from qpmpc.codegen.board.check import BoardResult
from qpmpc.report.charts import Panel, Series, held, over_time
from qpmpc.report.style import BLUE, GREY, VERMILION, png, tidy


def draw_board(result: BoardResult) -> bytes:
    """Draw the time of each step and the commands beside those expected.

    Returns
    -------
    PNG
    """
    log, data = result.log, result.summary()
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    times, power = figure.subplots(2, 1, sharex=True)
    time_s = np.arange(len(log.step))
    in_ms = result.milliseconds(1.0)
    label = f"{log.unit}\nper step" if in_ms is None else "ms per step"
    times.plot(time_s, log.step * (in_ms or 1.0), color=BLUE, linewidth=0.9)
    times.set_ylim(bottom=0.0)
    times.set_ylabel(label)
    power.plot(time_s, result.expected.power_w / 1e3, color=GREY, linewidth=1.6, label="here")
    power.plot(time_s, log.power_w / 1e3, color=VERMILION, linewidth=0.8, label="board")
    power.set_ylabel("engine power\nkW")
    power.set_xlabel("time, s")
    power.legend(fontsize=8, frameon=False)
    for axes in (times, power):
        tidy(axes)
    figure.suptitle(
        f"{data['cycle']}: {data['controller']} {data['precision']} on {log.board}", fontsize=11
    )
    return png(figure)


def board_chart(result: BoardResult) -> dict[str, Any]:
    """Return the same for the page to draw."""
    log = result.log
    in_ms = result.milliseconds(1.0)
    label = f"{log.unit} per step" if in_ms is None else "ms per step"
    times = Series("step", held(log.step * (in_ms or 1.0)), BLUE, stepped=True)
    power = [
        Series("here", held(result.expected.power_w / 1e3), GREY, "here", stepped=True),
        Series("board", held(log.power_w / 1e3), VERMILION, "board", stepped=True),
    ]
    panels = [Panel(label, [times], zero=True), Panel("engine power, kW", power)]
    return over_time(panels, [each.as_group() for each in power])
