"""The figures of a study as plain data."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from qpmpc.report.study.factors import factor_table
from qpmpc.report.study.figures import (
    ABOVE_DP,
    LIMITS,
    MEASURES,
    MOST_VALUES,
    SAVING,
    SETTING,
    Group,
    Measure,
    Study,
    distinct,
    group_columns,
    groups_of,
    main_measure,
    study_table,
)
from qpmpc.report.study.quantiles import FEWEST_FOR_TAIL, spread
from qpmpc.results import OPTIMUM, REFERENCE

if TYPE_CHECKING:
    from pandas import DataFrame


def study_summary(frame: "DataFrame", study: Study) -> dict[str, Any]:
    """Return the figures of a study, ready for strict JSON.

    Parameters
    ----------
    frame : one row per run, as the engine of studies returns it
    study : that was made

    Returns
    -------
    study : name, description, seed, what varies
    counts : runs planned, done, failed, not comparable, with violations (by limit), on fallbacks
    time : computing time and runs per second
    main_measure : key, title and unit of the figure that the report is about, and why
    groups : for each vehicle and controller (and forecast, and faults, where they vary): counts and
        `measures`, each as `spread` returns it
    slices : the same for each value of every setting with few values, by the name of its column
    factors, factor_remarks : how the main measure depends on what varies, see `factor_table`
    remarks : what a reader of the figures should know, one line each
    """
    table = study_table(frame)
    columns, remarks = group_columns(table)
    measure, why = main_measure(table)
    groups = sorted(groups_of(table, columns), key=_is_reference)
    factors, more = factor_table(table, study.varied, columns, measure)
    return {
        "study": {
            "name": study.name,
            "description": study.description,
            "seed": int(study.seed),
            "varied": list(study.varied),
        },
        "counts": _counts(table, study.runs),
        "time": _time(table, study),
        "main_measure": {
            "key": measure.key,
            "title": measure.title,
            "unit": measure.unit,
            "digits": measure.digits,
            "tail": measure.tail[0],
            "why": why,
        },
        "grouped_by": columns,
        "groups": [_group(group) for group in groups],
        "slices": {
            column: [_group(group) for group in groups_of(table, [*columns, column])]
            for column in _sliced(table, study.varied)
        },
        "factors": factors,
        "factor_remarks": more,
        "remarks": [why, *study.remarks, *remarks, *_remarks(table, groups, measure)],
        "provenance": {str(name): str(text) for name, text in study.provenance.items()},
    }


def _counts(table: "DataFrame", planned: int) -> dict[str, Any]:
    failed = int(table["failed"].sum())
    return {
        "planned": int(planned),
        "done": len(table) - failed,
        "failed": failed,
        "missing": max(int(planned) - len(table), 0),
        "not_comparable": int((~table["failed"] & ~table["comparable"]).sum()),
        "with_violation": int(table["violated"].sum()),
        "violations": {limit: int((table[f"violations.{limit}"] > 0.0).sum()) for limit in LIMITS},
        "with_fallback": int(table["fell_back"].sum()),
    }


def _is_reference(group: Group) -> bool:
    return group.names["controller"] in (REFERENCE, OPTIMUM)


def _group(group: Group) -> dict[str, Any]:
    table = group.table
    done = table[~table["failed"]]
    return {
        **group.names,
        "runs": len(table),
        "failed": int(table["failed"].sum()),
        "not_comparable": int((~done["comparable"]).sum()),
        "with_violation": int(done["violated"].sum()),
        "with_fallback": int(done["fell_back"].sum()),
        "worse_than_rules": int((done[SAVING.key] < 0.0).sum()),
        "cycles": done["cycle"].nunique(),
        "measures": {each.key: spread(done[each.key].to_numpy(float), each) for each in MEASURES},
    }


def _sliced(table: "DataFrame", varied: Sequence[str]) -> list[str]:
    return [
        column
        for column in varied
        if column.startswith(SETTING)
        and column in table
        and 1 < len(distinct(table, column)) <= MOST_VALUES
    ]


def _time(table: "DataFrame", study: Study) -> dict[str, float | None]:
    """Computing time of the runs; with the study's own time, what it spent beside them."""
    total = float(table["wall_s"].sum())
    elapsed, workers = (_given(study, name) for name in ("elapsed_s", "workers"))
    clock = elapsed or total / (workers or 1.0)
    inside = None if not elapsed or not workers else min(total / (elapsed * workers), 1.0)
    return {
        "runs_total_s": total,
        "elapsed_s": elapsed,
        "workers": workers,
        "runs_per_s": len(table) / clock if clock > 0.0 else None,
        "share_outside_runs": None if inside is None else 1.0 - inside,
    }


def _given(study: Study, name: str) -> float | None:
    with suppress(KeyError, ValueError):
        value = float(study.provenance[name])
        return value if 0.0 < value < float("inf") else None
    return None


def _remarks(table: "DataFrame", groups: Sequence[Group], measure: Measure) -> list[str]:
    remarks = []
    excluded = int((~table["failed"] & ~table["comparable"]).sum())
    if excluded:
        remarks.append(
            f"Left out of every fuel figure, since they are not comparable: {excluded:,}. They may "
            "well be the worst."
        )
    optima = table[(table["controller"] == OPTIMUM) & ~table["failed"]]
    beyond = int(optima["violated"].sum())
    if beyond:
        remarks.append(
            f"Dynamic programming found no way to keep all limits in {beyond:,} of "
            f"{len(optima):,} trips: those are beyond the car, and nothing is compared on them."
        )
    if len(table):
        remarks.append(
            "Intervals are 95 % confidence intervals: of quantiles between two of the sorted "
            f"values, of means by Student's t. A p95 has one from {FEWEST_FOR_TAIL} runs on."
        )
    if any(g.table["cycle"].nunique() < len(g.table) for g in groups):
        remarks.append(
            "Intervals take the runs as independent. Where several are on one cycle they resemble "
            "each other, and the intervals are too narrow."
        )
    lowest = table[ABOVE_DP.key].min()
    if measure is ABOVE_DP and lowest < 0.0:
        below = int((table[ABOVE_DP.key] < 0.0).sum())
        remarks.append(
            f"Runs below dp: {below:,}, by up to {-lowest:.2f} %: the SOC ends elsewhere, which "
            "its correction prices only approximately, or the grid of dp is too coarse."
        )
    return remarks
