"""Findings as sentences made from the numbers: agreement, disagreement, causes."""

from qpmpc.verification.reproduction import paper
from qpmpc.verification.reproduction.checks import CAUSAL, Check, order_of
from qpmpc.verification.reproduction.robustness import mean_loss_percent
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.tables import experiments_table
from qpmpc.verification.reproduction.thermal import thermal_story
from qpmpc.verification.reproduction.variants import (
    EXPERIMENTS,
    LATE_HEAT,
    OPTIMUM,
    OURS,
    PAPER_GRID,
    RULES,
    baseline,
)

CLOSE_SHARE = 0.25  # savings within this share of the printed one count as agreeing


def findings(study: Study, checks: list[Check]) -> list[tuple[str, list[str]]]:
    """Return paragraphs under headings.

    Parameters
    ----------
    checks : of the same study
    """
    return [
        ("In short", _summary(study, checks)),
        (
            "What agrees with the paper",
            _order(study, agreeing=True) + _savings(study, True) + _thermal(study),
        ),
        ("What differs", _order(study, agreeing=False) + _savings(study, False) + _failed(checks)),
        ("Why", _causes(study)),
    ]


def _summary(study: Study, checks: list[Check]) -> list[str]:
    held = sum(check.holds for check in checks)
    text = [f"{held} of {len(checks)} requirements hold."]
    for name in study.optima:
        row = study.rows[name, OURS]
        runs = [run for run in study.forecasts if run.cycle == name]
        text.append(
            f"{name}: {OURS} burns {row['fuel_soc_balanced_g']:.1f} g, "
            f"{row['fuel_above_dp_percent']:+.2f} % from dynamic programming and "
            f"{row['saving_vs_rule_percent']:.1f} % less than the rules; wrong forecasts cost it "
            f"{mean_loss_percent(runs):+.2f} % on average."
        )
    return text


def _order(study: Study, agreeing: bool) -> list[str]:
    text = []
    for cycle in study.extent.cycles:
        for ours in (OURS, PAPER_GRID):
            words, holds = order_of(study, cycle.name, ours)
            if holds == agreeing:
                verb = "holds" if holds else "does not hold"
                text.append(
                    f"{cycle.name}: the order DP, MH-MPC, H=100, H=20, rules {verb} with {ours} "
                    f"as MH-MPC: {', '.join(words)} g."
                )
    return text


def _savings(study: Study, agreeing: bool) -> list[str]:
    text = []
    for (cycle, name), printed in paper.SAVING_PERCENT.items():
        label = OURS if name == "mh" else name
        if (cycle, label) not in study.rows:
            continue
        saving = study.rows[cycle, label]["saving_vs_rule_percent"]
        if (abs(saving - printed) <= CLOSE_SHARE * printed) == agreeing:
            text.append(
                f"{cycle}: {label} saves {saving:.1f} % over the rules, the paper {printed:.1f} %."
            )
    return text


def _thermal(study: Study) -> list[str]:
    text = []
    for cycle in study.extent.cycles:
        best = thermal_story(study.runs[cycle.name, OPTIMUM])
        ours = thermal_story(study.runs[cycle.name, OURS])
        rules = thermal_story(study.runs[cycle.name, RULES])
        if best.released_mj > 0.0 and best.off_share_last > rules.off_share_last:
            text.append(
                f"{cycle.name}: the coolant is used as a store. DP releases "
                f"{best.released_mj:.2f} MJ between its hottest moment ({best.peak_s} s) and "
                f"arrival, {OURS} "
                f"{ours.released_mj:.2f} MJ, the rules {rules.released_mj:.2f} MJ; in the last "
                f"third of the trip the engine is off {100 * best.off_share_last:.0f} % (DP), "
                f"{100 * ours.off_share_last:.0f} % ({OURS}) and "
                f"{100 * rules.off_share_last:.0f} % (rules) of the time."
            )
        solution = study.optima[cycle.name]
        kelvin_mg = 1e3 * float(solution.t_cl_costate_g_per_k[0])
        text.append(
            f"{cycle.name}: at departure a kelvin of coolant is worth {kelvin_mg:.0f} mg of fuel "
            f"to DP, and a hundredth of SOC {10 * float(solution.soc_costate_g[0]):.0f} mg. Both "
            "are paid back later: heat by a smaller alpha and by seconds without the engine."
        )
    return text


def _failed(checks: list[Check]) -> list[str]:
    return [
        f"Does not hold: {check.name}: required {check.required}; measured {check.measured}."
        for check in checks
        if not check.holds
    ]


def _causes(study: Study) -> list[str]:
    text = [
        "The plant is not the paper's: its structure and limits are, but its road load, engine "
        "map, battery and cold multiplier come from public sources, because the paper's own data "
        "are not published. Percentages and shapes can be compared, grams cannot.",
        "The rules are not the paper's either: the paper does not give their thresholds.",
    ]
    for cycle in study.extent.cycles:
        text += _rules_range(study, cycle.name)
        text += _averaging(study, cycle.name)
        text += _iterations(study, cycle.name)
        text += _flattered(study, cycle.name)
    return text


def _rules_range(study: Study, cycle: str) -> list[str]:
    table = experiments_table(study).records()
    column = "saving of DP over these rules, %"
    cells = [row[column] for row in table if row["cycle"] == cycle]
    saved = [cell for cell in cells if isinstance(cell, float)]
    saved.append(study.rows[cycle, OPTIMUM]["saving_vs_rule_percent"])
    return [
        f"{cycle}: other plausible thresholds of the rules move DP's saving between "
        f"{min(saved):.1f} and {max(saved):.1f} %"
        + (
            f", on both sides of the paper's {printed:.1f} %."
            if min(saved) <= (printed := paper.SAVING_PERCENT[cycle, OPTIMUM]) <= max(saved)
            else f"; the paper's {printed:.1f} % is outside."
        ),
        *_heat_request(study, cycle),
    ]


def _heat_request(study: Study, cycle: str) -> list[str]:
    """The part of the saving that is due to the rules' heat request alone."""
    late_g = study.experiments[cycle, LATE_HEAT]["fuel_soc_balanced_g"]
    best_g = study.rows[cycle, OPTIMUM]["fuel_soc_balanced_g"]
    saving = study.rows[cycle, OPTIMUM]["saving_vs_rule_percent"]
    left = 100.0 * (1.0 - best_g / late_g)
    if left > 0.5 * saving:
        return []
    return [
        f"{cycle}: most of the saving over the rules is their heat request at 50 °C. The same "
        f"rules with the request at 42 °C leave DP {left:.1f} % to save, instead of {saving:.1f} %."
    ]


def _averaging(study: Study, cycle: str) -> list[str]:
    mean = study.rows[cycle, PAPER_GRID]["fuel_above_dp_percent"]
    classes, finer, exact = (
        study.experiments[cycle, variant.label]["fuel_above_dp_percent"]
        for variant in EXPERIMENTS[:3]
    )
    sentence = (
        f"{cycle}: on the paper's grid, where a block of 20 s has its mean demand, the controller "
        f"ends {mean:+.2f} % from DP. With three demand classes per block and nothing else changed "
        f"it is {classes:+.2f} %, with blocks of 5 s {finer:+.2f} %, and with 1000 iterations "
        f"instead of the fixed ones {exact:+.2f} %"
    )
    better = min(classes, finer) < mean - 0.1
    if better and exact > min(classes, finer) + 0.1:
        sentence += (
            ": the mean causes the loss. Averaging makes stop and go look like a gentle cruise "
            "that the battery could follow almost without loss."
        )
    else:
        sentence += "."
    return [sentence]


def _iterations(study: Study, cycle: str) -> list[str]:
    parts = []
    for horizon_s in (20, 100):
        label = baseline(horizon_s)
        fixed = study.rows[cycle, label]["fuel_above_dp_percent"]
        many = study.experiments[cycle, f"{label}, 1000 iterations"]["fuel_above_dp_percent"]
        parts.append(f"H={horizon_s}: {fixed:+.2f} % and {many:+.2f} %")
    return [
        f"{cycle}: the baseline's distance from DP with fixed and with 1000 iterations is "
        f"{'; '.join(parts)}: it comes from the short horizon, not from the solver."
    ]


def _flattered(study: Study, cycle: str) -> list[str]:
    ecms = study.rows[cycle, "ecms"]["fuel_above_dp_percent"]
    best = min(
        (label for label in CAUSAL if label.startswith("baseline")),
        key=lambda label: study.rows[cycle, label]["fuel_above_dp_percent"],
    )
    if ecms >= study.rows[cycle, best]["fuel_above_dp_percent"]:
        return []
    return [
        f"{cycle}: the adaptive ECMS, without any preview, is at {ecms:+.2f} %, nearer than the "
        f"best baseline ({best}). Its equivalence factor was tuned on these very cycles; a short "
        "preview is worth less than a good price of charge."
    ]
