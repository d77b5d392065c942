"""The runs of a study that a reader should look at: the worst, and those that failed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import isclose
from typing import TYPE_CHECKING, Any

from qpmpc.report.columns import NONE, number
from qpmpc.report.study.command import repeat_command
from qpmpc.report.study.figures import (
    LIMITS,
    MEASURES,
    SETTING,
    Measure,
    is_nothing,
    plain,
    short,
    subjects,
    value_text,
)
from qpmpc.report.study.page import Table
from qpmpc.results import OPTIMUM, Run

if TYPE_CHECKING:
    from pandas import DataFrame

WORST, DRAWN, MOST_FAILED = 10, 3, 20
SAME = 1e-6  # relative difference of fuel on other processors
LONGEST = 300  # characters of an error

Rerun = Callable[[Mapping[str, Any]], Run]


def worst_runs(table: "DataFrame", measure: Measure) -> "DataFrame":
    """Return the worst of the runs studied, the worst first."""
    studied = subjects(table)
    studied = studied[studied[measure.key].notna()]
    return studied.sort_values(measure.key, ascending=measure.worse == "low", kind="stable").head(
        WORST
    )


def runs_table(rows: "DataFrame", varied: Sequence[str]) -> Table:
    """Return parameters and figures of runs; columns without a value are left out."""
    names = ["cycle", "vehicle", "controller", "forecast", "faults"]
    names += [column for column in varied if column.startswith(SETTING) and column in rows]
    cells: dict[str, list[str]] = {"run": [str(run) for run in rows["run"]]}
    for name in names:
        if not all(is_nothing(value) for value in rows[name]):
            cells[name.removeprefix(SETTING)] = [value_text(plain(v)) for v in rows[name]]
    named = len(cells)
    for measure in MEASURES:
        if rows[measure.key].notna().any():
            cells[measure.heading] = [
                number(plain(value), measure.digits) for value in rows[measure.key]
            ]
    cells["limits violated"] = [
        ", ".join(text for limit, text in LIMITS.items() if row[f"violations.{limit}"] > 0) or NONE
        for row in rows.to_dict("records")
    ]
    return Table(list(cells), list(zip(*cells.values(), strict=True)), named)


def failed_table(rows: "DataFrame") -> Table:
    """Return names and errors of runs that failed."""
    names = ("cycle", "vehicle", "controller", "forecast", "faults")
    body = [
        [str(row["run"]), *(value_text(plain(row[n])) for n in names), short(row["error"], LONGEST)]
        for row in rows.to_dict("records")
    ]
    return Table(["run", *names, "error"], body, names=len(names) + 2)


def commands(frame: "DataFrame", rows: "DataFrame") -> list[tuple[str, str]]:
    """Return a heading and the command that repeats it for each of these rows."""
    return [
        (f"run {row['run']}", repeat_command(row))
        for row in frame.iloc[rows.index.to_numpy()].to_dict("records")
    ]


@dataclass
class Drawn:
    """Pictures of a study.

    Attributes
    ----------
    pictures : PNG by name
    charts : what the page draws itself, by the names of the pictures that it stands for
    remarks : a line for each that could not be made
    """

    pictures: dict[str, bytes] = field(default_factory=dict)
    charts: dict[str, dict[str, Any]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def _style_of(controllers: Sequence[str], _: str, place: int) -> dict[str, Any]:
    from qpmpc.report.style import line_style

    return line_style(controllers[place], place)


def draw_worst(frame: "DataFrame", table: "DataFrame", measure: Measure, rerun: Rerun) -> Drawn:
    """Drive the worst runs again and draw them, with dp on the same trip where the study has it.

    Parameters
    ----------
    frame, table : of the study, row by row the same runs
    rerun : drives the run of a row of `frame` again
    """
    from qpmpc.report.charts import run_chart
    from qpmpc.report.trajectories import draw_trajectories

    drawn = Drawn()
    best = table[(table["controller"] == OPTIMUM) & ~table["failed"]]
    for i, (place, row) in enumerate(worst_runs(table, measure).head(DRAWN).iterrows(), start=1):
        there = [] if is_nothing(row["trip_hash"]) else best["trip_hash"] == row["trip_hash"]
        places = [place, *best[there].index[:1]] if len(there) else [place]
        try:
            rows = [frame.iloc[each].to_dict() for each in places]
            runs = [rerun(each) for each in rows]
            drawn.pictures[f"worst_{i}"] = draw_trajectories(runs)
            drawn.charts[f"worst_{i}"] = run_chart(
                runs,
                [f"{short(r['controller'], LONGEST)} (run {r['run']})" for r in rows],
                partial(_style_of, [run.controller for run in runs]),
            )
            drawn.remarks += [
                f"run {each['run']} burns {run.fuel_g:.4g} g when it is driven again, not "
                f"{each['fuel_g']:.4g} g: a file that it needs, or the code, has changed"
                for each, run in zip(rows, runs, strict=True)
                if not isclose(run.fuel_g, each["fuel_g"], rel_tol=SAME)
            ]
        # whatever a user's own controller raises: the report has the rest
        except Exception as error:
            reason = short(f"{type(error).__name__}: {error}", LONGEST)
            drawn.remarks.append(f"run {row['run']} could not be driven again and drawn: {reason}")
    return drawn
