"""The table of a study's runs, as the report needs it: known types, derived figures, groups."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from qpmpc.results import OPTIMUM, REFERENCE
from qpmpc.shown import shown

if TYPE_CHECKING:
    from pandas import DataFrame

LIMITS = {"soc": "SOC", "t_cl_degc": "coolant temperature", "power_w": "power"}
NAMES = ("cycle", "vehicle", "controller", "forecast", "faults", "trip_hash", "error")
FLOATS = (
    *("distance_km", "duration_s", "fuel_soc_balanced_g", "engine_starts", "fallback_steps"),
    *("fuel_above_dp_percent", "saving_vs_rule_percent", "step_time_ms.p99", "wall_s"),
    *(f"violations.{limit}" for limit in LIMITS),
)
MOST_VEHICLES = 12  # with more, they are pooled
MOST_VALUES = 8  # of any other column, to be a column of groups
SETTING = "set."


class Study(Protocol):
    """What the report needs to know of a study beside its runs.

    Attributes
    ----------
    runs : number planned
    text : the study's file
    varied : columns of the table that the study varies
    remarks : what a reader should know about it, one line each
    provenance : name and text; `elapsed_s`, the time from the first start to the last end, and
        `workers` are used where they are given
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def description(self) -> str: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def runs(self) -> int: ...  # noqa: D102
    @property
    def text(self) -> str: ...  # noqa: D102
    @property
    def varied(self) -> Sequence[str]: ...  # noqa: D102
    @property
    def remarks(self) -> Sequence[str]: ...  # noqa: D102
    @property
    def provenance(self) -> Mapping[str, str]: ...  # noqa: D102


@dataclass(frozen=True)
class Measure:
    """A figure of a run: its column, title, unit, digits shown, and which side is the bad one."""

    key: str
    title: str
    unit: str
    digits: int
    worse: Literal["high", "low"] = "high"

    @property
    def heading(self) -> str:
        """Title with unit."""
        return f"{self.title}, {self.unit}"

    @property
    def tail(self) -> tuple[str, float]:
        """Key and order of the quantile at the bad side: five of a hundred runs are worse."""
        return ("p95", 0.95) if self.worse == "high" else ("p05", 0.05)


ABOVE_DP = Measure("fuel_above_dp_percent", "fuel above DP", "%", 2)
SAVING = Measure("saving_vs_rule_percent", "saving against the rules", "%", 2, "low")
FUEL = Measure("fuel_g_per_100km", "SOC-balanced fuel", "g/100 km", 0)
STARTS = Measure("engine_starts_per_km", "engine starts", "per km", 2)
STEP = Measure("step_time_ms.p99", "step time, 99th percentile", "ms", 3)
WALL = Measure("wall_s", "computing time of a run", "s", 2)
MEASURES = (ABOVE_DP, SAVING, FUEL, STARTS, STEP, WALL)


def study_table(frame: "DataFrame") -> "DataFrame":
    """Return the figures that the report is made of, one row per run, rows as in `frame`.

    Columns that the frame lacks are empty here. A fuel figure is NaN unless its run is comparable
    (see `qpmpc.Run`). Derived:

        fuel_g_per_100km = 100 m / distance,  engine_starts_per_km,  mean_speed_kmh,
        failed, comparable, violated, fell_back

    with m the SOC-balanced fuel.
    """
    from pandas import DataFrame

    columns: dict[str, Any] = {"run": _numbers(frame, "run").astype(np.int64)}
    columns |= {name: _texts(frame, name) for name in NAMES}
    columns |= {str(name): frame[name] for name in frame if str(name).startswith(SETTING)}
    columns |= {name: _numbers(frame, name) for name in FLOATS}
    failed = np.array([error is not None for error in columns["error"]], dtype=bool)
    comparable = ~failed & (_numbers(frame, "comparable") == 1.0)
    distance_km = _positive(columns["distance_km"])
    for name in ("fuel_above_dp_percent", "saving_vs_rule_percent", "fuel_soc_balanced_g"):
        columns[name] = np.where(comparable, columns[name], np.nan)
    excess = np.array([columns[f"violations.{limit}"] for limit in LIMITS])
    columns |= {
        "failed": failed,
        "comparable": comparable,
        "violated": ~failed & (excess > 0.0).any(axis=0),
        "fell_back": ~failed & (columns["fallback_steps"] > 0.0),
        "fuel_g_per_100km": 100.0 * columns["fuel_soc_balanced_g"] / distance_km,
        "engine_starts_per_km": columns["engine_starts"] / distance_km,
        "mean_speed_kmh": 3600.0 * distance_km / _positive(columns["duration_s"]),
    }
    return DataFrame({name: np.asarray(values) for name, values in columns.items()})


def _numbers(frame: "DataFrame", name: str) -> NDArray[np.float64]:
    """Return a column as floats, NaN where it has no finite number."""
    from pandas import to_numeric

    if name not in frame:
        return np.full(len(frame), np.nan)
    values = to_numeric(frame[name], errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    return np.where(np.isfinite(values), values, np.nan)


def _texts(frame: "DataFrame", name: str) -> NDArray[np.object_]:
    """Return a column as texts, None where it has none."""
    values = [None] * len(frame) if name not in frame else frame[name].tolist()
    texts = np.empty(len(frame), dtype=object)
    texts[:] = [None if is_nothing(value) else str(value) for value in values]
    return texts


def _positive(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(values > 0.0, values, np.nan)


def is_nothing(value: Any) -> bool:
    """Whether a cell is empty: None, NaN or pandas' NA."""
    from pandas import NA

    return value is None or value is NA or (isinstance(value, float) and bool(np.isnan(value)))


def plain(value: Any) -> Any:
    """Return a cell as Python's own type, None if it is empty."""
    if is_nothing(value):
        return None
    return value.item() if isinstance(value, np.generic) else value


def distinct(table: "DataFrame", column: str) -> list[Any]:
    """Return the values of a column, empty ones left out; numbers sorted, others as they come."""
    values = list(dict.fromkeys(plain(v) for v in table[column].tolist() if not is_nothing(v)))
    return sorted(values) if all(isinstance(v, int | float) for v in values) else values


@dataclass(frozen=True)
class Group:
    """Runs that belong together: the values that name them, and their part of the table."""

    names: dict[str, Any]
    table: "DataFrame"

    @property
    def label(self) -> str:
        """The values, in one line."""
        return ", ".join(value_text(value) for value in self.names.values())


def groups_of(table: "DataFrame", columns: Sequence[str]) -> list[Group]:
    """Split a table by the values of columns; those of one value of the first lie together."""
    found = [
        Group({column: plain(v) for column, v in zip(columns, values, strict=True)}, part)
        for values, part in table.groupby(list(columns), sort=False, dropna=False)
    ]
    orders = {
        column: {value: i for i, value in enumerate(distinct(table, column))} for column in columns
    }
    return sorted(
        found, key=lambda g: [orders[c].get(v, len(orders[c])) for c, v in g.names.items()]
    )


def group_columns(table: "DataFrame") -> tuple[list[str], list[str]]:
    """Return the columns that name a group, and remarks on what is pooled.

    Vehicle and controller; forecast and faults where they vary, since they decide what can be
    reached at all.
    """
    columns: list[str] = []
    remarks: list[str] = []
    for column, fewest, most in (
        ("vehicle", 0, MOST_VEHICLES),
        ("controller", 0, len(table)),
        ("forecast", 2, MOST_VALUES),
        ("faults", 2, MOST_VALUES),
    ):
        number = len(distinct(table, column)) + bool(table[column].isna().any())
        if fewest <= number <= most:
            columns.append(column)
        elif number > most:
            remarks.append(f"{column}: {number} values, which the tables and pictures pool.")
    return columns, remarks


def main_measure(table: "DataFrame") -> tuple[Measure, str]:
    """Return the measure that the report is about, and why that one."""
    if table[ABOVE_DP.key].notna().any():
        return ABOVE_DP, (
            "The main measure is the SOC-balanced fuel above that of dynamic programming, which "
            "depends on no rival's tuning."
        )
    if table[SAVING.key].notna().any():
        return SAVING, (
            "The main measure is the saving against the rules, since no trip was driven by dp "
            "too; it depends on the thresholds of the rules."
        )
    return FUEL, (
        "The main measure is the SOC-balanced fuel per 100 km, since there is neither dp nor "
        "rule-based to compare with on the same trips: it differs between trips more than between "
        "controllers."
    )


def subjects(table: "DataFrame") -> "DataFrame":
    """Return the runs that are studied: those of no reference, or all if there are no others."""
    for references in ([REFERENCE, OPTIMUM], [OPTIMUM]):
        others = table[~table["controller"].isin(references)]
        if len(others):
            return others
    return table


def value_text(value: Any) -> str:
    """Return a name or the value of a setting as tables show it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def short(text: str, longest: int) -> str:
    """Return text on one line, cut if it is long."""
    line = shown(" ".join(str(text).split()))
    return line if len(line) <= longest else line[: longest - 1] + "…"
