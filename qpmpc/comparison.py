"""Comparison of runs: savings over the rules, distance from the optimum."""

from collections.abc import Sequence
from typing import Any

from qpmpc.results import Run

REFERENCE, OPTIMUM = "rule-based", "dp"


def compare_runs(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return the summary of each run, set against the others on its cycle.

    saving_vs_rule_percent = 100 (1 - m / m_rule),   fuel_above_dp_percent = 100 (m / m_dp - 1)

    with m the SOC-balanced fuel. Null where there is no such run on the cycle, or it burns
    nothing. `comparable` of a run says whether its own m can be trusted (see `Run`).
    """
    balanced = {(run.cycle, run.controller): run.fuel_soc_balanced_g for run in runs}

    rows = []
    for run in runs:
        share = {
            other: run.fuel_soc_balanced_g / balanced[run.cycle, other]
            for other in (REFERENCE, OPTIMUM)
            if balanced.get((run.cycle, other), 0.0) > 0.0
        }
        rule, optimum = share.get(REFERENCE), share.get(OPTIMUM)
        rows.append(
            {
                **run.summary(),
                "saving_vs_rule_percent": None if rule is None else 100.0 * (1.0 - rule),
                "fuel_above_dp_percent": None if optimum is None else 100.0 * (optimum - 1.0),
            }
        )
    return rows
