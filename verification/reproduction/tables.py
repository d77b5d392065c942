"""Tables of the report."""

from dataclasses import astuple

import numpy as np

from qpmpc.verification.reproduction import paper
from qpmpc.verification.reproduction.checks import checks_of, grid_error_percent, margin_percent
from qpmpc.verification.reproduction.exhibits import Cell, Table
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.thermal import thermal_story
from qpmpc.verification.reproduction.variants import OPTIMUM, OURS, PAPER_GRID, VARIANTS

LABELS = [variant.label for variant in VARIANTS]


def printed_name(label: str) -> str:
    """Name of a controller in the paper's figures: both of our grids stand for its MH-MPC."""
    return "mh" if label in (OURS, PAPER_GRID) else label


def fuel_table(study: Study) -> Table:
    """Fuel, savings and distance from DP, with the paper's."""
    rows: list[list[Cell]] = []
    for cycle in study.extent.cycles:
        for label in LABELS:
            row = study.rows[cycle.name, label]
            name = printed_name(label)
            rows.append(
                [
                    cycle.name,
                    label,
                    row["fuel_soc_balanced_g"],
                    row["saving_vs_rule_percent"],
                    paper.SAVING_PERCENT.get((cycle.name, name)),
                    row["fuel_above_dp_percent"],
                    paper.above_dp_percent(cycle.name, name),
                    row["soc_end"],
                    row["engine_starts"],
                    row["step_time_ms"]["mean"],
                    _times_1e3(paper.STEP_TIME_S.get(name)),
                ]
            )
    return Table(
        "table_fuel",
        "Fuel, savings and time per step",
        "Balanced fuel counts the final SOC's difference at trip.eta_eq. The paper's distance from "
        f"DP follows from its savings; its times are from an {paper.COMPUTER}. It prints the "
        f"baseline on NYCC as up to {paper.BASELINE_BEST_NYCC_PERCENT} % only.",
        (
            "cycle",
            "controller",
            "balanced fuel, g",
            "saving, %",
            "paper: saving, %",
            "above DP, %",
            "paper: above DP, %",
            "final SOC",
            "engine starts",
            "mean time per step, ms",
            "paper: time per step, ms",
        ),
        rows,
        (0, 0, 1, 2, 2, 2, 2, 3, 0, 3, 0),
    )


def _times_1e3(value: float | None) -> float | None:
    return None if value is None else 1e3 * value


def cycles_table(study: Study) -> Table:
    """Distance from DP on every cycle."""
    rows: list[list[Cell]] = []
    for name, best in study.optima.items():
        for label in LABELS:
            row = study.rows[name, label]
            own_price = None if label == OPTIMUM else margin_percent(study, name, label)
            rows.append(
                [
                    name,
                    label,
                    row["fuel_soc_balanced_g"],
                    row["fuel_above_dp_percent"],
                    own_price,
                    row["soc_end"],
                    grid_error_percent(study, name) if label == OPTIMUM else None,
                    float(best.soc_efficiency[-1]) if label == OPTIMUM else None,
                ]
            )
    return Table(
        "table_cycles",
        "Distance from dynamic programming on all cycles",
        "Twice: with the final SOC at the fixed efficiency trip.eta_eq, and at dynamic "
        "programming's own costate, which is a lower bound of the distance from the best trip "
        "with that very final SOC. A run that ends high can look better than DP at the fixed "
        "price; it cannot at DP's own.",
        (
            "cycle",
            "controller",
            "balanced fuel, g",
            "above DP, %",
            "above DP at its SOC price, %",
            "final SOC",
            "DP grid error, %",
            "DP: efficiency of charge at the end",
        ),
        rows,
        (0, 0, 1, 2, 2, 3, 3, 3),
    )


def experiments_table(study: Study) -> Table:
    """Causes, by experiment."""
    rows: list[list[Cell]] = [
        [
            cycle,
            label,
            row["fuel_soc_balanced_g"],
            row["saving_vs_rule_percent"] if not label.startswith("rules") else None,
            _optimum_saving(study, cycle, row["fuel_soc_balanced_g"])
            if label.startswith("rules")
            else None,
            row["fuel_above_dp_percent"],
            row["soc_end"],
        ]
        for (cycle, label), row in study.experiments.items()
    ]
    return Table(
        "table_experiments",
        "Causes, by experiment",
        "Effects of the mean demand of a block, of the fixed number of iterations, and of the "
        "rules' thresholds on every saving. Each line changes one thing.",
        (
            "cycle",
            "experiment",
            "balanced fuel, g",
            "saving, %",
            "saving of DP over these rules, %",
            "above DP, %",
            "final SOC",
        ),
        rows,
        (0, 0, 1, 2, 2, 2, 3),
    )


def _optimum_saving(study: Study, cycle: str, rules_g: float) -> float:
    best_g: float = study.rows[cycle, OPTIMUM]["fuel_soc_balanced_g"]
    return 100.0 * (1.0 - best_g / rules_g)


def thermal_table(study: Study) -> Table:
    """The coolant as a store."""
    rows: list[list[Cell]] = [
        [cycle.name, label, *astuple(thermal_story(study.runs[cycle.name, label]))]
        for cycle in study.extent.cycles
        for label in LABELS
    ]
    return Table(
        "table_thermal",
        "The coolant as a store",
        "Heat stored: from the start to the highest temperature; released: from there to the end. "
        "Shares of time with the engine off, of the whole trip and of its last third.",
        (
            "cycle",
            "controller",
            "stored, MJ",
            "released, MJ",
            "hottest at, s",
            "highest SOC at, s",
            "engine off, share",
            "engine off in the last third, share",
            "engine off before arrival, s",
        ),
        rows,
        (0, 0, 3, 3, 0, 0, 2, 2, 0),
    )


def robustness_table(study: Study) -> Table:
    """Losses with wrong forecasts, by kind of error."""
    rows: list[list[Cell]] = []
    for cycle in study.optima:
        of_cycle = [run for run in study.forecasts if run.cycle == cycle]
        for model in [*dict.fromkeys(run.model for run in of_cycle), "all"]:
            runs = [run for run in of_cycle if model in (run.model, "all")]
            loss = np.array([run.loss_percent for run in runs])
            rows.append(
                [
                    cycle,
                    model,
                    len(runs),
                    float(loss.mean()),
                    float(np.percentile(loss, 95)),
                    float(loss.max()),
                    min(run.soc_end for run in runs),
                    max(run.soc_end for run in runs),
                    min(run.t_cl_min_degc for run in runs),
                    max(run.t_cl_max_degc for run in runs),
                    sum(run.violates for run in runs),
                    max(run.fallback_steps for run in runs),
                ]
            )
    return Table(
        "table_robustness",
        f"{OURS} with wrong forecasts",
        "Loss of SOC-balanced fuel to the same controller with the true forecast. The short window "
        "stays exact. Speed noise: 15 %, correlated over 20 s. Travel time: stretched by 5 %. "
        "Shift: 10 s. Stops: durations off by a factor with spread 0.5. Another day: the trip's "
        "micro-trips in random order. Combined: the first four at once.",
        (
            "cycle",
            "error",
            "forecasts",
            "mean loss, %",
            "95th percentile, %",
            "largest loss, %",
            "lowest final SOC",
            "highest final SOC",
            "coldest coolant, °C",
            "hottest coolant, °C",
            "with a violation",
            "fallback, s",
        ),
        rows,
        (0, 0, 0, 2, 2, 2, 3, 3, 2, 2, 0, 0),
    )


def checks_table(study: Study) -> Table:
    """Requirements and whether they hold."""
    rows: list[list[Cell]] = [list(astuple(check)) for check in checks_of(study)]
    return Table(
        "table_checks",
        "Requirements and whether they hold",
        "The requirements were set for the default car and its winter day; with other parameters "
        "they are shown all the same.",
        ("requirement", "required", "measured", "holds"),
        rows,
        (0, 0, 0, 0),
    )


def all_tables(study: Study) -> dict[str, Table]:
    """Every table by name."""
    made = (
        fuel_table(study),
        cycles_table(study),
        experiments_table(study),
        thermal_table(study),
        robustness_table(study),
        checks_table(study),
    )
    return {table.name: table for table in made}
