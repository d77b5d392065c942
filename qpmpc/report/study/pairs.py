"""Two studies compared, run by run on the same trips."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from qpmpc.report.study.command import repeat_command
from qpmpc.report.study.figures import (
    LIMITS,
    MOST_VEHICLES,
    SETTING,
    Study,
    distinct,
    is_nothing,
    plain,
    study_table,
)
from qpmpc.report.study.quantiles import mean_interval

if TYPE_CHECKING:
    from pandas import DataFrame

Floats = NDArray[np.float64]
Pair = dict[str, Any]

KEYS = ("cycle", "vehicle", "controller", "forecast", "faults")
FUEL, ABOVE = "fuel_percent", "above_dp_points"  # differences of two matched runs
TITLES = {FUEL: "SOC-balanced fuel, B against A, %", ABOVE: "fuel above DP, B less A, points"}
EQUAL = 1e-6  # differences up to here, in percent, are rounding
CHANGES = 10
NO_PAIRS = "No run of one study has a partner in the other."


def compare_studies(
    frame_a: "DataFrame", study_a: Study, frame_b: "DataFrame", study_b: Study
) -> dict[str, Any]:
    """Compare two studies, ready for strict JSON.

    Runs are matched by cycle, vehicle, controller, forecast, faults, seed, and the settings that
    both have and at least one varies. Of two matched runs that are comparable,

        fuel_percent = 100 (m_B / m_A - 1),   above_dp_points = fuel above DP of B less that of A

    with m the SOC-balanced fuel; negative is better in B.

    Returns
    -------
    compared : settings that do not vary within a study, but differ between the two
    matched_by : columns
    groups : for each vehicle and controller: matched, only_a, only_b, ambiguous (several runs that
        nothing distinguishes), failures and violations that appeared or vanished, and `differences`
    pairs : the matched runs, with their differences
    changes : the largest of them, with both commands
    remarks : what a reader should know
    """
    tables = [study_table(frame) for frame in (frame_a, frame_b)]
    for table, frame in zip(tables, (frame_a, frame_b), strict=True):
        table["seed"] = [plain(seed) for seed in frame["seed"]] if "seed" in frame else None
    compared, matching = _settings(*tables)
    keys = [*KEYS, "seed", *matching]
    rows_a, rows_b = (_rows(table, keys) for table in tables)
    names = ["vehicle", "controller"]
    if len({key[1] for key in [*rows_a, *rows_b]}) > MOST_VEHICLES:
        names = ["controller"]
    unique = [key for key in rows_a if key in rows_b and len(rows_a[key]) == len(rows_b[key]) == 1]
    pairs = [_pair(dict(zip(keys, k, strict=True)), rows_a[k][0], rows_b[k][0]) for k in unique]
    changes = sorted(
        (pair for pair in pairs if pair[FUEL] is not None and abs(pair[FUEL]) > EQUAL),
        key=lambda pair: abs(pair[FUEL]),
        reverse=True,
    )[:CHANGES]
    groups = [
        _group(dict(zip(names, each, strict=True)), keys, rows_a, rows_b, pairs)
        for each in dict.fromkeys(
            tuple(key[keys.index(n)] for n in names) for key in [*rows_a, *rows_b]
        )
    ]
    return {
        "a": _study(study_a, tables[0]),
        "b": _study(study_b, tables[1]),
        "compared": compared,
        "matched_by": keys,
        "grouped_by": names,
        "groups": groups,
        "pairs": pairs,
        "changes": [
            change
            | {
                "command_a": _command(frame_a, tables[0], change["run_a"]),
                "command_b": _command(frame_b, tables[1], change["run_b"]),
            }
            for change in changes
        ],
        "remarks": _remarks(groups, pairs, compared),
    }


def _study(study: Study, table: "DataFrame") -> dict[str, Any]:
    return {
        "name": study.name,
        "description": study.description,
        "seed": int(study.seed),
        "runs": len(table),
        "provenance": {str(name): str(text) for name, text in study.provenance.items()},
    }


def _settings(a: "DataFrame", b: "DataFrame") -> tuple[list[dict[str, Any]], list[str]]:
    """Return the settings that are compared, and the columns by which runs are matched."""
    compared, matching = [], []
    for column in dict.fromkeys([*a, *b]):
        if not column.startswith(SETTING):
            continue
        values = [distinct(table, column) if column in table else [] for table in (a, b)]
        if max(map(len, values)) > 1 and all(values):
            matching.append(column)
        elif values[0] != values[1]:
            given = {
                side: v[0] if len(v) == 1 else (f"{len(v)} values" if v else None)
                for side, v in zip("ab", values, strict=True)
            }
            compared.append({"setting": column.removeprefix(SETTING), **given})
    return compared, matching


def _rows(table: "DataFrame", keys: Sequence[str]) -> dict[tuple[Any, ...], list[dict[str, Any]]]:
    """Return the runs by what they are matched by."""
    found: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in table.to_dict("records"):
        found.setdefault(tuple(plain(row.get(key)) for key in keys), []).append(row)
    return found


def _pair(names: dict[str, Any], a: dict[str, Any], b: dict[str, Any]) -> Pair:
    fuel_a, fuel_b, above_a, above_b = (
        _number(row[key])
        for key in ("fuel_soc_balanced_g", "fuel_above_dp_percent")
        for row in (a, b)
    )
    return {
        "run_a": int(a["run"]),
        "run_b": int(b["run"]),
        **names,
        "fuel_a_g": fuel_a,
        "fuel_b_g": fuel_b,
        "above_dp_a_percent": above_a,
        "above_dp_b_percent": above_b,
        FUEL: 100.0 * (fuel_b / fuel_a - 1.0) if fuel_a and fuel_b and fuel_a > 0.0 else None,
        ABOVE: None if above_a is None or above_b is None else above_b - above_a,
        "failed": [bool(row["failed"]) for row in (a, b)],
        "violated": {
            limit: [bool(row[f"violations.{limit}"] > 0.0) for row in (a, b)] for limit in LIMITS
        },
        "same_trip": a["trip_hash"] == b["trip_hash"] or is_nothing(a["trip_hash"]),
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _group(
    names: dict[str, Any],
    keys: Sequence[str],
    rows_a: dict[tuple[Any, ...], list[dict[str, Any]]],
    rows_b: dict[tuple[Any, ...], list[dict[str, Any]]],
    pairs: Sequence[Pair],
) -> dict[str, Any]:
    def own(key: tuple[Any, ...]) -> bool:
        return all(key[keys.index(name)] == value for name, value in names.items())

    a, b = ({key: rows for key, rows in each.items() if own(key)} for each in (rows_a, rows_b))
    matched = [pair for pair in pairs if all(pair[n] == value for n, value in names.items())]
    both = [pair for pair in matched if not any(pair["failed"])]
    return {
        **names,
        "matched": len(matched),
        "only_a": sum(len(rows) for key, rows in a.items() if key not in b),
        "only_b": sum(len(rows) for key, rows in b.items() if key not in a),
        "ambiguous": sum(
            len(a[key]) + len(b[key]) for key in a if key in b and len(a[key]) + len(b[key]) > 2
        ),
        "failures": _changed(pair["failed"] for pair in matched),
        "violations": {
            limit: _changed(pair["violated"][limit] for pair in both) for limit in LIMITS
        },
        "differences": {
            kind: differences(np.array([p[kind] for p in matched if p[kind] is not None]))
            for kind in TITLES
        },
    }


def _changed(sides: Iterable[Sequence[bool]]) -> dict[str, int]:
    counts = Counter(tuple(each) for each in sides)
    return {"appeared": counts[False, True], "vanished": counts[True, False]}


def differences(values: Floats) -> dict[str, Any]:
    """Return the figures of paired differences, negative being better.

    Returns
    -------
    n, mean with ``mean_ci``, median, p05, p95, largest_better, largest_worse; counts better, worse
    and equal; and the p value of the sign test, two-sided, of as many better as worse
    """
    values = np.asarray(values, dtype=float)
    better, worse = int((values < -EQUAL).sum()), int((values > EQUAL).sum())
    counts = {
        "n": len(values),
        "better": better,
        "worse": worse,
        "equal": len(values) - better - worse,
        "sign_test_p": (
            float(binomtest(better, better + worse).pvalue) if better + worse else None
        ),
    }
    keys = ("mean", "mean_ci", "median", "p05", "p95", "largest_better", "largest_worse")
    if len(values) == 0:
        return counts | dict.fromkeys(keys)
    quantiles = np.quantile(values, [0.5, 0.05, 0.95]).tolist()
    figures = [float(values.mean()), mean_interval(values), *quantiles]
    ends = [float(values.min()) if better else None, float(values.max()) if worse else None]
    return counts | dict(zip(keys, [*figures, *ends], strict=True))


def _command(frame: "DataFrame", table: "DataFrame", run: int) -> str:
    (place, *_) = np.flatnonzero(table["run"] == run)
    return repeat_command(frame.iloc[place].to_dict())


def _remarks(
    groups: Sequence[dict[str, Any]], pairs: Sequence[Pair], compared: Sequence[dict[str, Any]]
) -> list[str]:
    remarks = [] if pairs else [NO_PAIRS]
    if pairs and not compared:
        remarks.append("No setting differs: the two differ in what no column shows, if at all.")
    ambiguous = sum(group["ambiguous"] for group in groups)
    if ambiguous:
        remarks.append(
            f"{ambiguous:,} runs are not matched: nothing that both studies have tells them apart."
        )
    other = sum(not pair["same_trip"] for pair in pairs)
    if other:
        remarks.append(
            f"In {other:,} of {len(pairs):,} pairs the trip, the vehicle or the weather is not "
            "the same: that is compared too."
        )
    unlike = sum(pair[FUEL] is None for pair in pairs)
    if unlike:
        remarks.append(
            f"{unlike:,} {'pair has' if unlike == 1 else 'pairs have'} no difference in fuel: "
            "one of the two failed or is not comparable."
        )
    if pairs:
        remarks.append(
            "Intervals: 95 %, Student's t, runs taken as independent. Sign test: how probable "
            "counts of better and worse at least as uneven are if both were equally probable."
        )
    return remarks
