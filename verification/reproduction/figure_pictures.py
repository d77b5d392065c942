"""Pictures of figures: alpha, fuel by horizon, fuel by controller, robustness, all cycles."""

import numpy as np
from matplotlib.figure import Figure

from qpmpc.report.style import BLACK, GREY, VERMILION, log_scale, tidy
from qpmpc.vehicle.engine import alpha
from qpmpc.verification.reproduction import paper
from qpmpc.verification.reproduction.drawing import WIDTH_IN, color
from qpmpc.verification.reproduction.exhibits import Picture
from qpmpc.verification.reproduction.figure_charts import (
    alpha_chart,
    bars_chart,
    distances_chart,
    losses_chart,
)
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.tables import LABELS, printed_name
from qpmpc.verification.reproduction.variants import OPTIMUM, OURS, PAPER_GRID, RULES, baseline

# Range of k by public sources: EPA's cold tests, ADVISOR's law (MODEL of this plant).
K_RANGE = (0.15, 0.525)


def alpha_picture(study: Study) -> Picture:
    """The paper's Fig. 2: fuel multiplier of a cold engine."""
    cold = study.vehicle.cold_engine
    temperature = np.linspace(min(40.0, study.vehicle.trip.t_cl_init_degc), 100.0, 121)
    used = alpha(cold, temperature)
    low, high = (alpha(cold.model_copy(update={"k": k}), temperature) for k in K_RANGE)
    figure = Figure(figsize=(6.0, 3.4), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(
        temperature,
        low,
        high,
        color="#dddddd",
        label=f"k from {K_RANGE[0]:g} to {K_RANGE[1]:g}: public sources",
    )
    axes.plot(temperature, used, color=VERMILION, label=f"this plant, k = {cold.k:g}")
    axes.set_xlabel("coolant, °C")
    axes.set_ylabel("alpha, fuel cold over hot")
    axes.set_title("Fuel multiplier of a cold engine (the paper's Fig. 2)", fontsize=11)
    axes.legend(frameon=False, fontsize=8.5)
    tidy(axes)
    return Picture(
        "alpha",
        "Fuel multiplier alpha of the coolant temperature",
        "The shape is the paper's: falling to 1 at the hot engine. Its curve is not public; ours "
        "is fitted to EPA's cold tests, within what public sources allow.",
        figure,
        {
            "t_cl_degc": temperature.tolist(),
            "alpha": used.tolist(),
            "alpha_low": low.tolist(),
            "alpha_high": high.tolist(),
        },
        alpha_chart(
            temperature,
            {
                f"this plant, k = {cold.k:g}": used,
                **{f"k = {k:g}": curve for k, curve in zip(K_RANGE, (low, high), strict=True)},
            },
        ),
    )


def horizon_fuel_picture(study: Study) -> Picture:
    """Fuel of the baseline by horizon, and its time per step."""
    labels = [*(baseline(horizon) for horizon in paper.HORIZONS_S), OPTIMUM]
    return _bars(
        study,
        labels,
        "fuel_horizon",
        "Fuel and time by horizon",
        "Fuel of the baseline above dynamic programming, and its mean time per step; the paper's "
        f"times are its own solver's on an {paper.COMPUTER}.",
    )


def fuel_picture(study: Study) -> Picture:
    """Fuel of all controllers, savings and time per step."""
    return _bars(
        study,
        LABELS,
        "fuel",
        "Fuel of all controllers",
        "SOC-balanced fuel, its difference from the rules, and the paper's where it prints one: "
        "in the page under the cursor, in the files in brackets.",
    )


def _bars(study: Study, labels: list[str], name: str, title: str, caption: str) -> Picture:
    cycles = [cycle.name for cycle in study.extent.cycles]
    figure = Figure(figsize=(WIDTH_IN, 6.2), layout="constrained")
    grid = figure.subplots(2, len(cycles), squeeze=False, gridspec_kw={"height_ratios": [3, 2]})
    data: dict[str, list[object]] = {
        key: []
        for key in (
            "cycle",
            "controller",
            "balanced_g",
            "saving_percent",
            "paper_saving_percent",
            "step_time_ms",
            "paper_step_time_ms",
        )
    }
    shown = [
        label.replace(" ", "\n", 1)
        .replace("mh-qp-paper", "mh-qp-\npaper")
        .replace("rule-based", "rule-\nbased")
        for label in labels
    ]
    for column, cycle in enumerate(cycles):
        fuel_axes, time_axes = grid[0, column], grid[1, column]
        for i, label in enumerate(labels):
            row = study.rows[cycle, label]
            fuel_g, mean_ms = row["fuel_soc_balanced_g"], row["step_time_ms"]["mean"]
            printed = paper.SAVING_PERCENT.get((cycle, printed_name(label)))
            printed_s = paper.STEP_TIME_S.get(printed_name(label))
            fuel_axes.bar(i, fuel_g, color=color(label), width=0.7)
            text = (
                f"{fuel_g:.1f}"
                if label == RULES
                else (f"{fuel_g:.1f}\n-{row['saving_vs_rule_percent']:.1f} %")
            )
            if printed is not None:
                text += f"\n[-{printed:.1f}]"
            fuel_axes.annotate(
                text,
                (i, fuel_g),
                ha="center",
                va="bottom",
                fontsize=7.5,
                xytext=(0, 2),
                textcoords="offset points",
            )
            if mean_ms:
                time_axes.plot(i, mean_ms, "o", color=color(label))
                time_axes.annotate(
                    f"{mean_ms:.2g}",
                    (i, mean_ms),
                    fontsize=7.5,
                    xytext=(5, 3),
                    textcoords="offset points",
                )
            if printed_s is not None:
                time_axes.plot(i, 1e3 * printed_s, "x", color=GREY)
            values = (
                cycle,
                label,
                fuel_g,
                row["saving_vs_rule_percent"],
                printed,
                mean_ms,
                None if printed_s is None else 1e3 * printed_s,
            )
            for key, value in zip(data, values, strict=True):
                data[key].append("" if value is None else value)
        fuels = [study.rows[cycle, label]["fuel_soc_balanced_g"] for label in labels]
        span = max(max(fuels) - min(fuels), 0.02 * max(fuels))
        fuel_axes.set_ylim(min(fuels) - 0.5 * span, max(fuels) + 0.45 * span)
        fuel_axes.set_title(cycle, fontsize=10, fontweight="bold")
        log_scale(time_axes, y=True)
        time_axes.set_ylim(1e-3, 1e4)
        for axes in (fuel_axes, time_axes):
            axes.set_xticks(range(len(labels)), shown)
            axes.set_xlim(-0.6, len(labels) - 0.4)
            tidy(axes)
            axes.tick_params(axis="x", labelsize=7)
    grid[0, 0].set_ylabel("balanced fuel, g (axis cut)")
    grid[1, 0].set_ylabel("mean time per step, ms\n(crosses: the paper's)")
    figure.suptitle(f"{title}; in brackets the paper's saving", fontsize=11)
    return Picture(name, title, caption, figure, data, bars_chart(study, labels))


def robustness_picture(study: Study) -> Picture:
    """Distribution of losses with wrong forecasts."""
    cycles = list(study.optima)
    columns = min(len(cycles), 3)
    rows = -(-len(cycles) // columns)
    figure = Figure(figsize=(WIDTH_IN, 2.6 * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes in grid.flat[len(cycles) :]:
        axes.set_visible(False)
    for axes, cycle in zip(grid.flat, cycles, strict=False):
        runs = [run for run in study.forecasts if run.cycle == cycle]
        models = list(dict.fromkeys(run.model for run in runs))
        for i, model in enumerate(models):
            loss = np.array([run.loss_percent for run in runs if run.model == model])
            spread = np.linspace(-0.25, 0.25, len(loss)) if len(loss) > 1 else np.zeros(1)
            axes.plot(
                loss, i + spread, "o", markersize=3, alpha=0.6, color=VERMILION, markeredgewidth=0
            )
            axes.plot([loss.mean()] * 2, [i - 0.35, i + 0.35], color=BLACK, linewidth=1.5)
        axes.axvline(0.0, color=GREY, linewidth=0.8)
        axes.set_yticks(range(len(models)), models)
        axes.invert_yaxis() if axes is grid.flat[0] else None
        bad = sum(run.violates for run in runs)
        axes.set_title(f"{cycle}: {bad} of {len(runs)} violate a limit", fontsize=9)
        axes.set_xlabel("loss of fuel, %")
        tidy(axes)
    figure.suptitle(f"{OURS} with wrong forecasts: loss against the true forecast", fontsize=11)
    return Picture(
        "robustness",
        "Wrong forecasts",
        "A dot is a trip, a bar or ring the mean of its kind. Below zero the forecast happened to "
        "save fuel, because the plan's model is not the plant.",
        figure,
        {
            key: [getattr(run, key) for run in study.forecasts]
            for key in (
                "cycle",
                "model",
                "seed",
                "loss_percent",
                "soc_end",
                "t_cl_min_degc",
                "t_cl_max_degc",
                "soc_violation",
                "t_cl_violation_k",
                "power_violation_w",
                "fallback_steps",
            )
        },
        losses_chart(study),
    )


def cycles_picture(study: Study) -> Picture:
    """Fuel above DP on every cycle."""
    labels = [label for label in LABELS if label not in (OPTIMUM, RULES)]
    figure = Figure(figsize=(WIDTH_IN, 0.55 * len(study.optima) + 1.6), layout="constrained")
    axes = figure.subplots()
    for i, cycle in enumerate(study.optima):
        for label in labels:
            above = study.rows[cycle, label]["fuel_above_dp_percent"]
            axes.plot(
                above,
                i,
                "D" if label == OURS else "o",
                color=color(label),
                markersize=8 if label == OURS else 6,
                label=label if i == 0 else None,
                zorder=3 if label in (OURS, PAPER_GRID) else 2,
            )
    axes.set_yticks(range(len(study.optima)), list(study.optima))
    axes.invert_yaxis()
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_xlabel("SOC-balanced fuel above dynamic programming, %")
    tidy(axes)
    figure.legend(loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8.5)
    return Picture(
        "cycles",
        "Distance from dynamic programming on all cycles",
        "Left is better. A point left of zero ends its trip at a high SOC, which the fixed "
        "efficiency of the balance flatters: see the table.",
        figure,
        {
            "cycle": [cycle for cycle in study.optima for _ in labels],
            "controller": labels * len(study.optima),
            "above_dp_percent": [
                study.rows[cycle, label]["fuel_above_dp_percent"]
                for cycle in study.optima
                for label in labels
            ],
        },
        distances_chart(study, labels, OURS),
    )
