"""Sets of trips beside the shipped cycles: the rows of the table, and the CSV of a trip."""

from collections.abc import Sequence

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.cycles.statistics import CycleStatistics, cycle_statistics
from qpmpc.report.columns import Column, Row

QUANTILES = {"5 %": 5.0, "median": 50.0, "95 %": 95.0}


def _column(title: str, key: str, digits: int) -> Column:
    return Column(title, lambda row: f"{row[key]:.{digits}f}")


FIGURES = (
    _column("duration s", "duration_s", 0),
    _column("km", "distance_km", 1),
    _column("mean km/h", "speed_mean_kmh", 1),
    _column("max km/h", "speed_max_kmh", 0),
    _column("stops/km", "stops_per_km", 2),
    _column("standing %", "standing_percent", 0),
    _column("RPA m/s²", "rpa_mps2", 2),
    _column("v·a+ 95 % W/kg", "va_p95_wpkg", 1),
    _column("grade sd %", "grade_sd_percent", 1),
    _column("steepest %", "grade_max_percent", 1),
    _column("climb m/km", "climb_m_per_km", 1),
)
CYCLE_COLUMNS = (Column("cycle", lambda row: row["name"], is_name=True), *FIGURES)
TRIP_COLUMNS = (
    Column("cycle", lambda row: row["name"], is_name=True),
    Column("type", lambda row: row.get("type", "-"), is_name=True),
    *FIGURES,
)
SET_COLUMNS = (
    Column("cycle", lambda row: row["name"], is_name=True),
    Column("", lambda row: row.get("quantile", ""), is_name=True),
    *FIGURES,
)


def cycle_row(cycle: Cycle) -> Row:
    """Return a row with the statistics of a cycle."""
    return {"name": cycle.name, **cycle_statistics(cycle)._asdict()}


def quantile_rows(name: str, rows: Sequence[Row]) -> list[Row]:
    """Return rows with quantiles of each figure over the trips of a set."""
    keys = CycleStatistics._fields
    table = np.asarray([[row[key] for key in keys] for row in rows])
    return [
        {"name": name, "quantile": label}
        | dict(zip(keys, np.percentile(table, percent, axis=0).tolist(), strict=True))
        for label, percent in QUANTILES.items()
    ]


def cycle_csv(cycle: Cycle) -> str:
    """Return a cycle as the CSV that `load_cycle` reads, digit by digit."""
    columns = (cycle.time_s.tolist(), cycle.speed_mps.tolist(), cycle.grade.tolist())
    rows = zip(*columns, strict=True)
    return "time_s,speed_mps,grade\n" + "".join(f"{t:.0f},{v!r},{g!r}\n" for t, v, g in rows)
