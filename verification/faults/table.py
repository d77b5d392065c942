"""One row for each fault: the worst over several beginnings, for two durations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from qpmpc.faults.effects import OWN
from qpmpc.registry import ControllerLike
from qpmpc.simulation import VehicleLike, simulate
from qpmpc.verification.faults.standard import DURATIONS_S, STARTS_S

CYCLE = "nycc"
TARGET_PERCENT = dict(zip(DURATIONS_S, (0.1, 1.0), strict=True))
HEADER = (
    "| fault | "
    + " | ".join(f"{s} s: fuel %, least … most | met again, s | fallback s" for s in DURATIONS_S)
    + " | who drove | flags | limits |\n|---|"
    + "---:|---:|---:|" * len(DURATIONS_S)
    + "---|---|---|\n"
)


@dataclass(frozen=True)
class Cell:
    """A fault of one duration, over its beginnings.

    Attributes
    ----------
    least_percent, most_percent : change of SOC-balanced fuel
    met_after_s : longest time from its end until the unfaulted trajectory is met again; None if it
        was not met in some run
    fallback_s : most seconds, until then, that something else than the controller's own plan drove
    """

    least_percent: float
    most_percent: float
    met_after_s: int | None
    fallback_s: int

    @property
    def worst_percent(self) -> float:
        """Largest change, whatever its sign."""
        return max(abs(self.least_percent), abs(self.most_percent))


@dataclass(frozen=True)
class Row:
    """A fault, with a cell for each duration."""

    what: str
    cells: dict[int, Cell]
    rungs: tuple[str, ...]
    flags: tuple[str, ...]
    violations: dict[str, float]


def measured(
    fault: dict[str, Any],
    vehicle: VehicleLike,
    controller: ControllerLike = "mh-qp",
    settings: dict[str, object] | None = None,
) -> Row:
    """Drive a fault alone from every beginning, for every duration."""
    timed = [
        {**fault, "at_s": start, "for_s": seconds} for seconds in DURATIONS_S for start in STARTS_S
    ]
    run = simulate(CYCLE, controller, vehicle, faults=timed, settings=settings)
    return _row(run.faults["each"] if run.faults else [])


def measured_job(job: tuple[dict[str, Any], str]) -> Row:
    """`measured` for another process, which cannot take a function from `__main__`."""
    return measured(*job)


def _row(effects: list[dict[str, Any]]) -> Row:
    names = {rung for each in effects for rung in each["drove"]} - {OWN}
    flags = {flag for each in effects for flag in each["flags"]}
    return Row(
        effects[0]["what"],
        {s: _cell([each for each in effects if each["for_s"] == s]) for s in DURATIONS_S},
        tuple(sorted(names)),
        tuple(sorted(flags)),
        {
            name: max(each["violations"][name] for each in effects)
            for name in effects[0]["violations"]
        },
    )


def _cell(effects: list[dict[str, Any]]) -> Cell:
    percent = [each["fuel_percent"] for each in effects]
    ends = [each["at_s"] + each["for_s"] for each in effects]
    met = [each["met_again_s"] for each in effects]
    after = [m - end for m, end in zip(met, ends, strict=True) if m is not None]
    return Cell(
        min(percent),
        max(percent),
        max(0, *after) if len(after) == len(effects) else None,
        max(sum(each["drove"].values()) - each["drove"].get(OWN, 0) for each in effects),
    )


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a Markdown table; changes beyond the target are bold."""
    return HEADER + "".join(_line(row) for row in rows)


def summary(rows: Sequence[Row]) -> str:
    """Return how many faults keep the targets."""
    parts = []
    for seconds, target in TARGET_PERCENT.items():
        kept = sum(row.cells[seconds].worst_percent < target for row in rows)
        parts.append(f"after {seconds} s {kept} of {len(rows)} faults stay below {target:g} %")
    return "; ".join(parts) + "."


def _line(row: Row) -> str:
    cells = " | ".join(_text(seconds, cell) for seconds, cell in row.cells.items())
    limits = ", ".join(f"{k} {v:.2g}" for k, v in row.violations.items() if v > 0.0)
    return (
        f"| {row.what} | {cells} | {', '.join(row.rungs) or '-'} | "
        f"{', '.join(row.flags) or '-'} | {limits or 'kept'} |\n"
    )


def _text(seconds: int, cell: Cell) -> str:
    fuel = f"{_signed(cell.least_percent)} … {_signed(cell.most_percent)}"
    if cell.worst_percent >= TARGET_PERCENT[seconds]:
        fuel = f"**{fuel}**"
    met = "never" if cell.met_after_s is None else str(cell.met_after_s)
    return f"{fuel} | {met} | {cell.fallback_s}"


def _signed(percent: float) -> str:
    text = f"{percent:+.2f}"
    return "0.00" if float(text) == 0.0 else text
