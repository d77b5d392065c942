"""Picture of a drive cycle."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qpmpc.cycles import Cycle
from qpmpc.report.style import BLACK, BLUE, GREEN, png, tidy


def draw_cycle(cycle: Cycle) -> bytes:
    """Draw speed, acceleration and, where there is any, grade over time.

    Returns
    -------
    PNG
    """
    hilly = bool(cycle.grade.any())
    figure = Figure(figsize=(9.0, 5.2 if hilly else 4.0), layout="constrained")
    panels = list(figure.subplots(3 if hilly else 2, 1, sharex=True, squeeze=False)[:, 0])
    speed, accel = panels[0], panels[1]
    speed.fill_between(
        cycle.time_s, 3.6 * cycle.speed_mps, color="#cccccc", edgecolor=BLACK, linewidth=0.8
    )
    speed.set_ylabel("speed\nkm/h")
    speed.set_ylim(bottom=0)
    accel.stairs(cycle.step_accel_mps2, cycle.time_s, color=BLUE, baseline=None)
    accel.axhline(0, color=BLACK, linewidth=0.5)
    accel.set_ylabel("acceleration\nm/s²")
    if hilly:
        draw_grade(panels[2], cycle)
    return finished(figure, panels, cycle)


def draw_grade(axes: Axes, cycle: Cycle) -> None:
    """Draw the grade over time."""
    axes.plot(cycle.time_s, 100 * cycle.grade, color=GREEN)
    axes.set_ylabel("grade\n%")


def finished(figure: Figure, panels: Sequence[Axes], cycle: Cycle) -> bytes:
    """Name the axis of time and the cycle, and return the picture as PNG.

    Parameters
    ----------
    panels : one below the other, over the time of the cycle
    """
    for axes in panels:
        tidy(axes)
    panels[-1].set_xlabel("time, s")
    panels[-1].set_xlim(0, cycle.duration_s)
    figure.align_ylabels()
    figure.suptitle(
        f"{cycle.name}: {cycle.duration_s:.0f} s, {cycle.distance_m / 1e3:.2f} km", fontsize=11
    )
    return png(figure)
