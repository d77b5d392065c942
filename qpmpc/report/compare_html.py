"""The HTML report of a comparison: one self-contained file."""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence

import numpy as np

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.report.answer import comparison_answer
from qpmpc.report.charts import run_chart
from qpmpc.report.columns import Row, compare_columns, filled, notes
from qpmpc.report.html import html_page, preformatted
from qpmpc.report.parameter_rows import parameter_rows
from qpmpc.report.provenance import provenance
from qpmpc.results import INTEGRAL, OPTIMUM, REFERENCE, Run


def compare_html(
    runs: Sequence[Run],
    rows: Sequence[Row],
    settings: ControllerSettings,
    pictures: Mapping[str, bytes],
) -> str:
    """Return the report.

    Parameters
    ----------
    runs : all with one vehicle
    rows : the same runs, as `compare_runs` returns them
    settings : that they were made with
    pictures : PNG of each cycle
    """
    vehicle = runs[0].vehicle
    columns = filled(compare_columns(rows), rows)
    # the rules are also the last resort of other controllers
    names = {"rule_based", *(run.controller.replace("-", "_") for run in runs)}
    if "mh_nlp" in names:
        names.add("mh_qp")  # has its horizon and limits
    if settings.others:
        names.add("others")
    return html_page(
        "qpmpc.report",
        "compare.html.j2",
        title="Controllers compared",
        answer=comparison_answer(rows),
        vehicle=vehicle,
        plant=runs[0].plant["name"] if runs[0].plant else "",
        columns=columns,
        rows=rows,
        marks=notes(rows),
        remarks=_remarks(rows, settings),
        relaxed=[row for row in rows if row["sigma_integral_share"] is not None],
        fractional=[
            _fractional_demand(run)
            for run, row in zip(runs, rows, strict=True)
            if row["sigma_integral_share"] is not None
        ],
        integral_percent=100.0 * INTEGRAL,
        pictures={cycle: b64encode(data).decode() for cycle, data in pictures.items()},
        charts={
            cycle: run_chart([run for run in runs if run.cycle == cycle]) for cycle in pictures
        },
        parameters=[row for section in parameter_rows(vehicle) for row in section],
        settings=preformatted(json.dumps(settings.model_dump(include=names), indent=2)),
        provenance=provenance(),
    )


def _fractional_demand(run: Run) -> str:
    """Quartiles of the demand in the steps whose on-share was fractional, kW."""
    share, demand = run.trajectory.on_share, run.trajectory.demand_w
    there = demand[(share > INTEGRAL) & (share < 1.0 - INTEGRAL)] / 1e3
    if len(there) == 0:
        return "-"
    low, high = np.percentile(there, [25, 75])
    return f"{low:.1f} to {high:.1f}"


def _remarks(rows: Sequence[Row], settings: ControllerSettings) -> list[str]:
    """Remarks that a reader needs to judge the table."""
    present = {row["controller"] for row in rows}
    solved_by = ", ".join(
        dict.fromkeys(
            f"{row['controller']} by {row['solver']['name']} ({row['solver']['implementation']})"
            for row in rows
            if row["solver"]["name"]
        )
    )
    remarks = [
        "Balanced fuel is the fuel burnt plus that which the difference between initial and final "
        "SOC is worth: at the price that dp found where it drove the cycle, else at the efficiency "
        "trip.eta_eq. Savings and distances compare balanced fuel.",
        "Controllers with a preview get the true trip, in the short and in the long horizon: "
        "no forecast error.",
        "Step times are wall times of one decision in this Python process, all runs one after the "
        "other. A QP controller that is prepared (its setting below) solves its first QP before "
        "the trip starts: that time is not among them. The work of a step of ours is the same each "
        "time; that the longest takes a multiple of the median is the operating system, which "
        "counted instructions leave out (docs/timing.md). "
        + (f"Solved: {solved_by}." if solved_by else ""),
    ]
    if REFERENCE in present:
        remarks.append(
            "The saving depends on the thresholds of the rules more than on any parameter of the "
            "car: read the distance from dynamic programming as well, where there is one."
        )
        if settings.rule_based.balance:
            remarks.append(
                "The SOC reference of the rules was chosen for each trip, knowing it, so that the "
                "trip ends as nearly as possible at the SOC asked for."
            )
    if OPTIMUM in present and not any("plant" in row for row in rows):
        remarks.append(
            "dp is dynamic programming: it knows the whole trip and the plant itself, could not "
            "run in a car, and has no time per step."
        )
        worst = min((row["fuel_above_dp_percent"] for row in rows), default=0.0)
        if worst < 0.0:
            remarks.append(
                f"A run is {-worst:.2f} % below dp. The SOC of that run ends elsewhere, which its "
                "correction prices only approximately, or the grid of dp is too coarse."
            )
    violated = [row for row in rows if any(row["violations"].values())]
    names = ", ".join(f"{row['controller']} on {row['cycle']}" for row in violated)
    remarks.append(f"Limits were violated by: {names}." if names else "No limit was violated.")
    fallbacks = [row for row in rows if row["fallback_steps"]]
    if fallbacks:
        names = ", ".join(
            f"{row['controller']} on {row['cycle']} ({row['fallback_steps']} s)"
            for row in fallbacks
        )
        remarks.append(f"A fallback drove instead of the optimiser: {names}.")
    return [*remarks, *dict.fromkeys(remark for row in rows for remark in row["remarks"])]
