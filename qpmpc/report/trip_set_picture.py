"""Picture of the distributions of a set of trips, with the shipped cycles marked."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from qpmpc.report.columns import Row
from qpmpc.report.style import SKY, VERMILION, png, tidy

PANELS: tuple[tuple[str, str, tuple[int, ...]], ...] = (  # key, title, ticks if logarithmic
    ("duration_s", "duration, s", (120, 300, 1000, 3000, 7200)),
    ("distance_km", "distance, km", (1, 3, 10, 30, 100)),
    ("speed_mean_kmh", "mean speed, km/h", ()),
    ("stops_per_km", "stops per km", ()),
    ("standing_percent", "standing, % of the time", ()),
    ("rpa_mps2", "relative positive acceleration, m/s²", ()),
    ("va_p95_wpkg", "95th percentile of v·a+, W/kg", ()),
    ("grade_sd_percent", "standard deviation of the grade, %", ()),
    ("climb_m_per_km", "climb, m per km", ()),
)
BINS = 20


def draw_trip_set(name: str, rows: Sequence[Row], shipped: Sequence[Row]) -> bytes:
    """Draw a histogram of each figure.

    Parameters
    ----------
    name : of the set
    rows : of its trips, as `cycle_row` makes them
    shipped : rows of the cycles to mark

    Returns
    -------
    PNG
    """
    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    for axes, (key, title, log_ticks) in zip(figure.subplots(3, 3).flat, PANELS, strict=True):
        values = [row[key] for row in rows]
        low, high = min(values), max(values)
        edges = [low + (high - low) * i / BINS for i in range(BINS + 1)]
        if log_ticks:
            axes.set_xscale("log")
            axes.set_xticks(log_ticks, [str(tick) for tick in log_ticks])
            axes.set_xticks([], minor=True)
            edges = [low * (high / low) ** (i / BINS) for i in range(BINS + 1)]
        axes.hist(values, bins=edges, color=SKY, edgecolor="white", linewidth=0.4)
        tidy(axes)
        top = axes.get_ylim()[1]
        level = all(row[key] == 0.0 for row in shipped)
        labels = {0.0: "all shipped"} if level else {row[key]: row["name"] for row in shipped}
        for i, (value, label) in enumerate(sorted(labels.items())):
            axes.axvline(value, color=VERMILION, linewidth=0.9)
            axes.text(
                value, top * (1.0 - 0.11 * i), f" {label}", fontsize=6.5, color=VERMILION, va="top"
            )
        axes.set_xlabel(title)
        axes.set_ylabel("trips")
    figure.suptitle(f"{name}: {len(rows)} trips", fontsize=11)
    return png(figure)
