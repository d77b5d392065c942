"""The page of a study, and its pictures."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from qpmpc.report.columns import NONE, number
from qpmpc.report.html import preformatted
from qpmpc.report.study.answer import runs_text, study_answer
from qpmpc.report.study.distribution_chart import distribution_chart
from qpmpc.report.study.factor_chart import factor_charts
from qpmpc.report.study.figures import (
    ABOVE_DP,
    MEASURES,
    SAVING,
    Measure,
    Study,
    main_measure,
    study_table,
    value_text,
)
from qpmpc.report.study.markdown import NO_RUNS, headline, interval_text
from qpmpc.report.study.page import Section, Table, chosen, page, table_of
from qpmpc.report.study.pictures import column_text, draw_distribution, draw_factor
from qpmpc.report.study.worst import (
    DRAWN,
    MOST_FAILED,
    Drawn,
    Rerun,
    commands,
    draw_worst,
    failed_table,
    runs_table,
    worst_runs,
)
from qpmpc.shown import shown

if TYPE_CHECKING:
    from pandas import DataFrame

MOST_COLUMNS = 8  # of groups, in the table of factors


def study_pictures(
    frame: "DataFrame", summary: Mapping[str, Any], rerun: Rerun | None = None
) -> Drawn:
    """Draw the pictures of a study.

    Parameters
    ----------
    frame : one row per run
    summary : as `study_summary` returns it
    rerun : drives the run of a row again, for the trajectories of the worst; None: without them
    """
    table, columns = study_table(frame), summary["grouped_by"]
    measure, _ = main_measure(table)
    made = {
        f"distribution_{each.key}": draw_distribution(table, columns, each)
        for each in dict.fromkeys((measure, ABOVE_DP, SAVING))
    }
    for factor in summary["factors"]:
        column = factor["column"]
        made[f"factor_{column}"] = draw_factor(table, columns, measure, column)
    drawn = Drawn() if rerun is None else draw_worst(frame, table, measure, rerun)
    drawn.pictures = {k: data for k, data in made.items() if data is not None} | drawn.pictures
    return drawn


def study_page(
    frame: "DataFrame",
    study: Study,
    summary: Mapping[str, Any],
    drawn: Drawn,
) -> str:
    """Return the report of a study.

    Parameters
    ----------
    frame : one row per run
    summary : as `study_summary` returns it
    drawn : as `study_pictures` returns it
    """
    pictures = drawn.pictures
    table = study_table(frame)
    measure, _ = main_measure(table)
    varied = ", ".join(column.removeprefix("set.") for column in study.varied)
    quiet = f"Study of {study.runs:,} runs, seed {study.seed}. Varied: {varied or 'nothing'}."
    sections = [
        _first(study, summary),
        Section(
            "Distributions",
            _distribution_text(pictures),
            pictures=chosen(pictures, "distr"),
            charts=_charts(table, summary, pictures),
        ),
        _factors(table, summary, pictures, measure),
        _all_figures(summary),
        _worst(frame, table, study, measure, drawn),
        _failed(frame, table),
        Section(
            "What was run",
            [_time_text(summary["time"])],
            [table_of(summary["provenance"])] if summary["provenance"] else [],
            texts=[
                ("The study's file", preformatted("\n".join(map(shown, study.text.split("\n")))))
            ],
        ),
    ]
    return page(study.name, study_answer(summary), quiet, sections)


def _first(study: Study, summary: Mapping[str, Any]) -> Section:
    header, rows = headline(summary)
    names = len(summary["grouped_by"])
    title = f"{summary['main_measure']['title']}, {summary['main_measure']['unit']}"
    title = title[0].upper() + title[1:]
    return Section(
        paragraphs=[study.description] if study.description else [],
        tables=[Table(header, rows, names, title + " [95 % confidence interval]")] if rows else [],
        remarks=summary["remarks"] if rows else [],
    )


def _distribution_text(pictures: Mapping[str, bytes]) -> list[str]:
    if any(name.startswith("distribution") for name in pictures):
        return [
            "The value that a share of the runs does not exceed. In the pictures beside this page, "
            "left: share of the runs by value; right: share of the runs up to a value."
        ]
    return ["No run has a figure to draw."]


def _charts(
    table: "DataFrame", summary: Mapping[str, Any], pictures: Mapping[str, bytes]
) -> dict[str, dict[str, Any]]:
    """Return a chart for each picture of a distribution, by the names of `chosen`."""
    return {
        name.replace("_", " "): distribution_chart(table, summary["grouped_by"], measure)
        for measure in MEASURES
        if (name := f"distribution_{measure.key}") in pictures
    }


def _factors(
    table: "DataFrame",
    summary: Mapping[str, Any],
    pictures: Mapping[str, bytes],
    measure: Measure,
) -> Section:
    title = f"What the {measure.title} depends on"
    factors = summary["factors"]
    if not factors:
        return Section(
            title, ["Nothing varies, or too few runs tell."], remarks=summary["factor_remarks"]
        )
    names = summary["grouped_by"]
    groups = factors[0]["groups"][:MOST_COLUMNS]
    fewest = min((each["n"] for each in groups if each["n"] > 1), default=2)
    header = [
        "factor",
        *(f"{', '.join(value_text(g[n]) for n in names)} ({g['n']:,})" for g in groups),
    ]
    rows = [
        [column_text(factor["column"]) + ("" if factor["numeric"] else " (categories)")]
        + [number(each["correlation"], 2) for each in factor["groups"][:MOST_COLUMNS]]
        for factor in factors
    ]
    left = len(factors[0]["groups"]) - len(groups)
    return Section(
        title,
        [
            "Numbers: Spearman's rank correlation. Categories: square root of the share of the "
            "variance of the ranks that they explain. Strongest first. Chance alone gives sizes up "
            f"to {1.96 / (fewest - 1) ** 0.5:.2f} in one of 20 correlations of {fewest:,} runs. A "
            "correlation is no cause: what varies together shows the same.",
            *([f"{left} more groups are in summary.json."] if left else []),
        ],
        [Table(header, rows)],
        summary["factor_remarks"],
        pictures=chosen(pictures, "factor"),
        charts={
            name.replace("_", " "): factor_charts(
                table, names, measure, name.removeprefix("factor_")
            )
            for name in pictures
            if name.startswith("factor_")
        },
    )


def _all_figures(summary: Mapping[str, Any]) -> Section:
    names = summary["grouped_by"]
    tables = _figure_tables(summary["groups"], names)
    folded = [
        (f"By {column_text(column)}", _figure_tables(groups, [*names, column]))
        for column, groups in summary["slices"].items()
    ]
    return Section("All figures", [] if tables else [NO_RUNS], tables, folded=folded)


def _figure_tables(groups: list[dict[str, Any]], names: list[str]) -> list[Table]:
    """Return a table for each measure that has values."""
    tables = []
    for measure in MEASURES:
        keys = ("median", measure.tail[0], "worst", "mean")
        rows = []
        for group in groups:
            figures = group["measures"][measure.key]
            cells = [interval_text(figures, key, measure.digits) for key in keys]
            if figures["n"]:
                rows.append([*(value_text(group[n]) for n in names), f"{figures['n']:,}", *cells])
        if rows:
            header = [*(name.removeprefix("set.") for name in names), "n", *keys]
            tables.append(Table(header, rows, len(names), measure.heading))
    return tables


def _worst(
    frame: "DataFrame",
    table: "DataFrame",
    study: Study,
    measure: Measure,
    drawn: Drawn,
) -> Section:
    worst = worst_runs(table, measure)
    title = f"The worst runs by {measure.title}"
    if len(worst) == 0:
        return Section(title, [f"No run has a {measure.title}."])
    shown_runs = chosen(drawn.pictures, "worst")
    text = f"Of {', '.join(dict.fromkeys(worst['controller']))}; the references are left out."
    return Section(
        title,
        [text, *([f"Drawn below: up to {DRAWN} of them, the worst first."] if shown_runs else [])],
        [runs_table(worst, study.varied)],
        drawn.remarks,
        shown_runs,
        commands(frame, worst),
        charts={name.replace("_", " "): chart for name, chart in drawn.charts.items()},
    )


def _failed(frame: "DataFrame", table: "DataFrame") -> Section:
    failed = table[table["failed"]]
    if len(failed) == 0:
        return Section("Failed runs", ["No run failed."])
    shown_rows = failed.head(MOST_FAILED)
    text = f"{runs_text(len(failed))} failed"
    text += f"; the first {MOST_FAILED} are shown." if len(failed) > MOST_FAILED else "."
    return Section(
        "Failed runs", [text], [failed_table(shown_rows)], texts=commands(frame, shown_rows)
    )


def _time_text(time: Mapping[str, float | None]) -> str:
    rate, elapsed, outside = (
        time[key] for key in ("runs_per_s", "elapsed_s", "share_outside_runs")
    )
    parts = [f"Computing time of all runs: {number(time['runs_total_s'], 1)} s"]
    parts += [f"time from start to end: {elapsed:.1f} s"] if elapsed else []
    parts += (
        [f"{rate:.3g} runs per second" + ("" if elapsed else ", one at a time")] if rate else []
    )
    parts += [f"{100.0 * outside:.1f} % of it outside the runs"] if outside is not None else []
    return ("; ".join(parts) or NONE) + "."
