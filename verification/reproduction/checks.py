"""Requirements, and whether they hold."""

from dataclasses import dataclass

from qpmpc.verification.reproduction.robustness import mean_loss_percent
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.variants import (
    OPTIMUM,
    OURS,
    PAPER_GRID,
    RULES,
    VARIANTS,
    baseline,
)

GRID_ERROR_PERCENT = 0.1
ABOVE_DP_PERCENT = {"nycc": 0.5, "nedc-truncated": 0.2}
ABOVE_DP_ELSEWHERE_PERCENT = 0.5
MEAN_LOSS_PERCENT = 1.0
CAUSAL = [variant.label for variant in VARIANTS if variant.label != OPTIMUM]


@dataclass(frozen=True)
class Check:
    """A requirement.

    Attributes
    ----------
    name : the requirement
    required, measured : in words and numbers
    holds : whether it is met
    """

    name: str
    required: str
    measured: str
    holds: bool


def grid_error_percent(study: Study, cycle: str) -> float:
    """Value function minus realised fuel of dynamic programming, relative to its fuel."""
    best = study.optima[cycle]
    return 100.0 * abs(best.gap_g) / best.fuel_total_g


def margin_percent(study: Study, cycle: str, label: str) -> float:
    """`Study.above_optimum_g`, relative to the least fuel."""
    return 100.0 * study.above_optimum_g(cycle, label) / study.optima[cycle].fuel_total_g


def order_of(study: Study, cycle: str, ours: str) -> tuple[list[str], bool]:
    """Balanced fuel in the paper's order and whether DP <= MH < H=100 <= H=20 < rules."""
    labels = (OPTIMUM, ours, baseline(100), baseline(20), RULES)
    fuel = [study.rows[cycle, label]["fuel_soc_balanced_g"] for label in labels]
    dp, mh, long, short, rules = fuel
    holds = dp <= mh < long <= short < rules
    return [f"{name} {grams:.1f}" for name, grams in zip(labels, fuel, strict=True)], holds


def checks_of(study: Study) -> list[Check]:
    """Evaluate every requirement on a study."""
    found = []
    for name, best in study.optima.items():
        error = grid_error_percent(study, name)
        found.append(
            Check(
                f"{name}: dynamic programming resolved",
                f"value function within {GRID_ERROR_PERCENT} % of realised fuel, inside its tube",
                f"{error:.3f} %{'' if best.converged else ', at the edge of its tube'}",
                best.admissible and best.converged and error <= GRID_ERROR_PERCENT,
            )
        )
    for name in study.optima:
        margins = {label: margin_percent(study, name, label) for label in CAUSAL}
        lowest = min(margins, key=lambda label: margins[label])
        allowed = max(grid_error_percent(study, name), GRID_ERROR_PERCENT)
        found.append(
            Check(
                f"{name}: no causal controller beats dynamic programming",
                f"not below it by more than {allowed:.2f} %, final SOC at its costate",
                f"lowest is {lowest}, {margins[lowest]:+.2f} %",
                margins[lowest] >= -allowed,
            )
        )
    for name in study.optima:
        most = ABOVE_DP_PERCENT.get(name, ABOVE_DP_ELSEWHERE_PERCENT)
        above = study.rows[name, OURS]["fuel_above_dp_percent"]
        found.append(
            Check(
                f"{name}: {OURS} close to dynamic programming",
                f"at most {most} % above",
                f"{above:+.3f} %",
                above <= most,
            )
        )
    for cycle in study.extent.cycles:
        for ours in (OURS, PAPER_GRID):
            words, holds = order_of(study, cycle.name, ours)
            found.append(
                Check(
                    f"{cycle.name}: the paper's order, with {ours} as MH-MPC",
                    "DP <= MH < H=100 <= H=20 < rules",
                    " / ".join(words) + " g",
                    holds,
                )
            )
    for name in study.optima:
        runs = [run for run in study.forecasts if run.cycle == name]
        mean, bad = mean_loss_percent(runs), sum(run.violates for run in runs)
        found.append(
            Check(
                f"{name}: wrong forecasts cost little",
                f"mean loss at most {MEAN_LOSS_PERCENT} %, no limit violated",
                f"{mean:+.2f} % over {len(runs)} forecasts, {bad} with a violation",
                mean <= MEAN_LOSS_PERCENT and not bad,
            )
        )
    bad_runs = [key for key, row in study.rows.items() if any(row["violations"].values())]
    found.append(
        Check(
            "all cycles: limits kept with the true forecast",
            "no violation",
            ", ".join(f"{label} on {cycle}" for cycle, label in bad_runs) or "none",
            not bad_runs,
        )
    )
    return found
