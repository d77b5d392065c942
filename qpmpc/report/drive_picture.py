"""Picture of a converted log: its samples, and the drive that was made of them."""

import numpy as np
from matplotlib.figure import Figure

from qpmpc.cycles.logs.elevation import filtered_elevation
from qpmpc.cycles.read_drive import Drive
from qpmpc.report.cycle_picture import draw_grade, finished
from qpmpc.report.style import BLACK, SKY

SAMPLE = {"linestyle": "", "marker": "o", "markersize": 3.5, "color": SKY}


def draw_drive(drive: Drive) -> bytes:
    """Draw samples and driven speed over time; where the log has them, elevation and grade.

    Returns
    -------
    PNG
    """
    cycle, log = drive.cycle, drive.log
    has_height = log.elevation_m is not None and bool(np.any(np.isfinite(log.elevation_m)))
    hilly = bool(cycle.grade.any())
    count = 1 + has_height + hilly
    figure = Figure(figsize=(9.0, 1.6 + 1.7 * count), layout="constrained")
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    elapsed_s = log.time_s - log.time_s[0]
    speed, *others = panels
    speed.plot(elapsed_s, 3.6 * log.speed_mps, **SAMPLE, label=f"{len(elapsed_s)} samples")
    speed.plot(cycle.time_s, 3.6 * cycle.speed_mps, color=BLACK, linewidth=0.9, label="driven")
    speed.set_ylabel("speed\nkm/h")
    speed.set_ylim(bottom=0)
    speed.legend(loc="upper right", fontsize=8, frameon=False)
    if has_height:
        axes = others.pop(0)
        way_m, places_m, height_m = filtered_elevation(log)
        axes.plot(elapsed_s, log.elevation_m, **SAMPLE)
        axes.plot(elapsed_s, np.interp(way_m, places_m, height_m), color=BLACK, label="filtered")
        axes.set_ylabel("elevation\nm")
        axes.legend(fontsize=8, frameon=False)
    if hilly:
        draw_grade(others[0], cycle)
    return finished(figure, panels, cycle)
