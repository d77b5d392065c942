"""Columns of the tables of runs, the same in the terminal and in the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from qpmpc.shown import two_digits

Row = dict[str, Any]

NOT_COMPARABLE = "*"
NONE = "-"


@dataclass(frozen=True)
class Column:
    """A column: its title, with the unit, and the function from a run's JSON to a cell."""

    title: str
    text: Callable[[Row], str]
    is_name: bool = False


def number(value: float | None, digits: int) -> str:
    """Return a number with fixed digits, never "-0"; `NONE` if there is none."""
    if value is None:
        return NONE
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _marked(row: Row, key: str, digits: int) -> str:
    """Number, if there is one, with the mark of runs that are not comparable."""
    value = row.get(key)
    text = number(value, digits)
    return text if row["comparable"] or value is None else text + NOT_COMPARABLE


def _is_priced(row: Row) -> bool:
    """Whether dp found what the final SOC of this run is worth."""
    return row.get("fuel_soc_balanced_dp_g") is not None


def _balanced(row: Row) -> str:
    return "fuel_soc_balanced_dp_g" if _is_priced(row) else "fuel_soc_balanced_g"


def balanced_fuel_g(row: Row) -> float:
    """Return the SOC-balanced fuel that runs are compared by."""
    return float(row[_balanced(row)])


def _range(low: float, high: float, digits: int) -> str:
    return f"{low:.{digits}f}..{high:.{digits}f}"


def violations_text(row: Row) -> str:
    """Largest excess over each limit that was violated."""
    found = row["violations"]
    parts = [
        (found["soc"], f"SOC {found['soc']:.2g}"),
        (found["t_cl_degc"], f"T_cl {found['t_cl_degc']:.2g} K"),
        (found["power_w"], f"{two_digits(found['power_w'])} W"),
    ]
    return ", ".join(text for excess, text in parts if excess > 0.0) or "none"


def _times(row: Row) -> str:
    times = row["step_time_ms"]
    if times["median"] is None:
        return NONE
    return " / ".join(f"{times[key]:.3g}" for key in ("median", "p99", "max"))


def _percent(row: Row, key: str) -> str:
    share = row[key]
    return number(None if share is None else 100.0 * share, 1)


NAMES = (
    Column("cycle", lambda row: row["cycle"], is_name=True),
    Column("controller", lambda row: row["controller"], is_name=True),
)
FUEL = (
    Column("fuel g", lambda row: number(row["fuel_g"], 1)),
    Column("balanced g", lambda row: _marked(row, _balanced(row), 1)),
)
AGAINST = (
    Column("saving %", lambda row: _marked(row, "saving_vs_rule_percent", 2)),
    Column("saving vs own %", lambda row: _marked(row, "saving_vs_own_control_percent", 2)),
    Column("above DP %", lambda row: _marked(row, "fuel_above_dp_percent", 2)),
)
STATE = (
    Column("SOC", lambda row: _range(row["soc_min"], row["soc_max"], 3)),
    Column("T_cl °C", lambda row: _range(row["t_cl_min_degc"], row["t_cl_max_degc"], 1)),
)
OPERATION = (
    Column("starts", lambda row: str(row["engine_starts"])),
    Column("per km", lambda row: number(row["engine_starts_per_km"], 2)),
    Column("shortest run s", lambda row: number(row["engine_on_s"]["min"], 0)),
    Column("below 3 s %", lambda row: _percent(row, "engine_runs_below_3s_share")),
    Column("violations", violations_text),
    Column("fallback s", lambda row: str(row["fallback_steps"])),
    Column("integral %", lambda row: _percent(row, "sigma_integral_share")),
    Column("step ms med / p99 / max", _times),
)

SIMULATE_COLUMNS = (*NAMES, *FUEL, *STATE, *OPERATION)
COMPARE_COLUMNS = (*NAMES, *FUEL, *AGAINST, *STATE, *OPERATION)


def compare_columns(rows: Sequence[Row]) -> tuple[Column, ...]:
    """Return the columns of a comparison, with those of the users' own figures."""
    own = dict.fromkeys(name for row in rows for name in row.get("figures", {}))
    return (*NAMES, *FUEL, *AGAINST, *map(_of_figure, own), *STATE, *OPERATION)


def _of_figure(name: str) -> Column:
    def text(row: Row) -> str:
        value = row.get("figures", {}).get(name)
        return NONE if value is None else f"{value:.4g}"

    return Column(name.replace("_", " "), text)


def filled(columns: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    """Return the columns that have a figure in any of the rows."""
    return [column for column in columns if any(column.text(row) != NONE for row in rows)]


def _references(row: Row) -> tuple[str, ...]:
    """Controllers that percentages of a row refer to."""
    return ("rule-based", "dp", *([row["plant"]["name"]] if "plant" in row else []))


def notes(rows: Sequence[Row]) -> list[str]:
    """Sentences that explain the marks in a table of these rows."""
    found = []
    if not all(row["comparable"] for row in rows):
        found.append(
            f"{NOT_COMPARABLE} not comparable: final SOC too far from the initial one, a limit "
            "exceeded, or mostly on fallbacks; the remarks say which"
        )
    if any(not r["comparable"] and r["controller"] in _references(r) for r in rows):
        found.append("  percentages against such a run are no more certain than the run itself")
    of_dp = [row for row in rows if row["controller"] == "dp" and _is_priced(row)]
    prices = {row["cycle"]: row["soc_price_g"] for row in of_dp}
    if prices:
        each = ", ".join(f"{price:.1f} on {cycle}" for cycle, price in prices.items())
        found.append(f"final SOC at the price that dp found, in g per unit of SOC: {each}")
    return found
