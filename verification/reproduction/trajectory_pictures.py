"""Pictures over time: baseline, horizons, all controllers, costates."""

from typing import Any

import numpy as np

from qpmpc.report.charts import Panel, Series, groups_of, held, lines, numbers, over_time
from qpmpc.report.style import BLACK, BLUE, GREY, ORANGE, PURPLE
from qpmpc.verification.reproduction.drawing import (
    chart,
    engine_panel,
    finish,
    look,
    panels,
    series,
    speed_panel,
    state_panels,
    style,
)
from qpmpc.verification.reproduction.exhibits import Picture
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.variants import OPTIMUM, OURS, PAPER_GRID, RULES, baseline


def baseline_picture(study: Study, cycle: str) -> Picture:
    """Trajectories of the baseline MPC."""
    labels = [baseline(20), baseline(100)]
    figure, axes = panels(5)
    speed, short, long, soc, coolant = axes
    run = study.runs[cycle, labels[0]]
    speed_panel(speed, run)
    for panel, label in zip((short, long), labels, strict=True):
        engine_panel(panel, study.runs[cycle, label], label)
    long.sharey(short)
    state_panels(soc, coolant, study, cycle, labels)
    return Picture(
        f"baseline_{cycle}",
        f"Baseline MPC on {cycle}",
        "The baseline's SOC hardly moves: its penalty pulls it back at the end of every horizon.",
        finish(figure, axes, f"{cycle}: baseline MPC", soc),
        series(study, cycle, labels),
        chart(study, cycle, labels),
    )


def horizon_picture(study: Study) -> Picture:
    """SOC for short and long horizons against DP, all of the paper's cycles."""
    labels = [baseline(20), baseline(100), OPTIMUM]
    cycles = [cycle.name for cycle in study.extent.cycles]
    figure, axes = panels(len(cycles), 2.3)
    data: dict[str, object] = {}
    soc_panels = []
    for panel, cycle in zip(axes, cycles, strict=True):
        soc_panels.append(Panel(f"{cycle}: SOC", []))
        for label in labels:
            soc = study.runs[cycle, label].trajectory.soc
            soc_panels[-1].series.append(Series(label, numbers(soc), group=label, **look(label)))
            panel.plot(soc, label=label, **style(label))
            data[f"{cycle} {label} soc"] = soc.tolist()
        panel.set_ylabel("SOC")
        panel.set_title(cycle, loc="left", fontsize=9.5, fontweight="bold")
    longest = max(len(study.runs[cycle, OPTIMUM].trajectory.soc) for cycle in cycles)
    return Picture(
        "soc_horizon",
        "SOC by length of the horizon",
        "With a longer horizon the SOC moves more as in dynamic programming.",
        finish(figure, axes, "SOC of the baseline for H = 20 and 100 s, and of DP", axes[0]),
        {"time_s": range(longest), **data},  # type: ignore[dict-item]
        over_time(soc_panels, groups_of(soc_panels)),
    )


def all_picture(study: Study, cycle: str) -> Picture:
    """SOC and coolant of rules, baseline, MH-MPC and DP."""
    labels = [RULES, baseline(100), PAPER_GRID, OURS, OPTIMUM]
    figure, axes = panels(4, 1.9)
    speed, soc, coolant, fuel = axes
    speed_panel(speed, study.runs[cycle, OURS])
    state_panels(soc, coolant, study, cycle, labels)
    for label in labels:
        burnt = np.concatenate([[0.0], np.cumsum(study.runs[cycle, label].trajectory.fuel_g)])
        fuel.plot(burnt, **style(label))
    fuel.set_ylabel("fuel burnt\ng")
    fuel.set_ylim(bottom=0)
    return Picture(
        f"trajectories_{cycle}",
        f"All controllers on {cycle}",
        "SOC, coolant and fuel of the rules, the baseline, both multi-horizon grids and DP.",
        finish(figure, axes, f"{cycle}: SOC, coolant, fuel", soc),
        series(study, cycle, labels),
        chart(study, cycle, labels),
    )


def thermal_picture(study: Study, cycle: str) -> Picture:
    """Worth of charge and heat to the optimum, and their use in it."""
    best, run = study.optima[cycle], study.runs[cycle, OPTIMUM]
    figure, axes = panels(5)
    speed, engine, soc, coolant, worth = axes
    speed_panel(speed, run)
    engine_panel(engine, run, OPTIMUM)
    soc.plot(best.soc, color=BLUE, linewidth=1.2)
    soc.set_ylabel("SOC")
    coolant.plot(study.runs[cycle, OURS].trajectory.t_cl_degc, label=OURS, **style(OURS))
    coolant.plot(best.t_cl_degc, label=OPTIMUM, **style(OPTIMUM))
    coolant.set_ylabel("coolant\n°C")
    worth.plot(1e3 * best.t_cl_costate_g_per_k, color=PURPLE, linewidth=1.2)
    worth.set_ylabel("a kelvin's\nworth, mg")
    worth.set_ylim(bottom=min(0.0, float(1.1e3 * best.t_cl_costate_g_per_k.min())))
    twin = worth.twinx()
    twin.plot(best.soc_costate_g / 100.0, color=BLUE, linewidth=1.0)
    twin.set_ylabel("SOC: worth of\n0.01, g", fontsize=8.5, color=BLUE)
    twin.tick_params(labelsize=8, colors=BLUE)
    worth.yaxis.label.set_color(PURPLE)
    worth.tick_params(axis="y", colors=PURPLE)
    twin.spines[["top", "left"]].set_color("none")
    soc.axhline(study.vehicle.trip.soc_init, color=BLACK, linewidth=0.5)
    return Picture(
        f"thermal_{cycle}",
        f"The coolant as a store: dynamic programming on {cycle}",
        "The costates are the fuel that a kelvin of coolant and a hundredth of SOC save later. "
        "Heat is worth least where the trip no longer needs it: a warm engine at arrival is waste.",
        finish(figure, axes, f"{cycle}: worth of heat and charge", coolant),
        {
            "time_s": range(len(best.soc)),
            "soc": best.soc.tolist(),
            "t_cl_degc": best.t_cl_degc.tolist(),
            "engine_on": best.engine_on.astype(int).tolist(),
            "p_eng_w": best.p_eng_w.tolist(),
            "soc_costate_g": best.soc_costate_g.tolist(),
            "soc_efficiency": best.soc_efficiency.tolist(),
            "t_cl_costate_g_per_k": best.t_cl_costate_g_per_k.tolist(),
            "heat_costate_g_per_mj": best.heat_costate_g_per_mj.tolist(),
        },
        _thermal_chart(study, cycle),
    )


def _thermal_chart(study: Study, cycle: str) -> dict[str, Any]:
    best, trajectory = study.optima[cycle], study.runs[cycle, OPTIMUM].trajectory
    ours = study.runs[cycle, OURS].trajectory.t_cl_degc
    coolant = [
        Series(OURS, numbers(ours), group=OURS, **look(OURS)),
        Series(OPTIMUM, numbers(best.t_cl_degc), group=OPTIMUM, **look(OPTIMUM)),
    ]
    speed = Series("speed", held(3.6 * trajectory.speed_mps), GREY, fill=True, stepped=True)
    engine = Series("engine", held(trajectory.p_eng_w / 1e3), ORANGE, fill=True, stepped=True)
    worth_mg, worth_g = 1e3 * best.t_cl_costate_g_per_k, best.soc_costate_g / 100.0
    panels = [
        Panel("speed, km/h", [speed], zero=True, height=110),
        Panel(f"{OPTIMUM}: engine power, kW", [engine]),
        Panel(f"{OPTIMUM}: SOC", [Series("SOC", numbers(best.soc), BLUE)]),
        Panel("coolant, °C", coolant),
        Panel("worth of a kelvin of coolant, mg", [Series("worth", numbers(worth_mg), PURPLE)]),
        Panel("worth of 0.01 of SOC, g", [Series("worth", numbers(worth_g), BLUE)]),
    ]
    return over_time(panels, groups_of(panels))


def _concept_chart(study: Study) -> dict[str, Any]:
    panels = []
    seconds = 0
    for shot in study.snapshots:
        stages, x = shot.plan.stages, shot.plan.x
        used = stages.duration_s > 0.0
        ends = shot.step + np.cumsum(stages.duration_s[used])
        road = shot.truth.battery_side_w(study.vehicle) / 1e3
        seconds = max(seconds, len(road))
        at = np.unique([*range(len(road)), *ends[ends < len(road)]])
        # the stage that a time is in; before the first there is none
        stage = np.searchsorted(ends, at, side="right").clip(max=len(ends) - 1)
        planned = np.where(at >= shot.step, stages.net_w[used][stage] / 1e3, np.nan)
        tint = look(shot.label)["color"]
        panels += [
            Panel(
                f"{shot.label}, {int(used.sum())} stages at {shot.step} s: net power, kW",
                [
                    Series("the road", numbers(road[at.astype(int)]), GREY, stepped=True),
                    Series("stages of the horizon", numbers(planned), tint, stepped=True),
                ],
                x=numbers(at),
            ),
            *(
                Panel(
                    f"{shot.label}: planned {what}",
                    [Series("plan", numbers(x[used, i]), tone, joined=True, size=5)],
                    x=numbers(ends),
                )
                for i, what, tone in ((0, "SOC", BLUE), (1, "coolant, °C", ORANGE))
            ),
        ]
    return lines(np.arange(seconds + 1), "time, s", "s", panels, [])


def concept_picture(study: Study) -> Picture:
    """Short and long horizon of one step, from real data: the paper's grid and ours."""
    count = len(study.snapshots)
    figure, axes = panels(2 * count, 1.6)
    data: dict[str, object] = {}
    for i, shot in enumerate(study.snapshots):
        demand, plan_panel = axes[2 * i], axes[2 * i + 1]
        stages, x = shot.plan.stages, shot.plan.x
        used = stages.duration_s > 0.0
        edges = shot.step + np.concatenate([[0.0], np.cumsum(stages.duration_s[used])])
        truth = shot.truth.battery_side_w(study.vehicle) / 1e3
        demand.stairs(
            truth,
            np.arange(len(truth) + 1),
            baseline=None,
            color="#bbbbbb",
            linewidth=0.7,
            label="the road",
        )
        demand.stairs(
            stages.net_w[used] / 1e3,
            edges,
            baseline=None,
            linewidth=1.4,
            color=style(shot.label)["color"],
            label="stages of the horizon",
        )
        demand.axvline(shot.step, color=BLACK, linewidth=0.8)
        demand.set_ylabel("net power\nkW")
        demand.legend(fontsize=8, frameon=False, ncols=2, loc="upper right")
        demand.set_title(
            f"{shot.label}: {int(used.sum())} stages at {shot.step} s",
            loc="left",
            fontsize=9.5,
            fontweight="bold",
        )
        plan_panel.plot(edges[1:], x[used, 0], ".-", color=BLUE, markersize=3, linewidth=0.9)
        plan_panel.set_ylabel("planned\nSOC", color=BLUE)
        twin = plan_panel.twinx()
        twin.plot(edges[1:], x[used, 1], ".-", color=ORANGE, markersize=3, linewidth=0.9)
        twin.set_ylabel("planned\ncoolant, °C", fontsize=8.5, color=ORANGE)
        twin.tick_params(labelsize=8)
        data[f"{shot.label} stage_end_s"] = edges[1:].tolist()
        data[f"{shot.label} duration_s"] = stages.duration_s[used].tolist()
        data[f"{shot.label} net_w"] = stages.net_w[used].tolist()
        data[f"{shot.label} soc"] = x[used, 0].tolist()
        data[f"{shot.label} t_cl_degc"] = x[used, 1].tolist()
    name = study.extent.cycles[0].name
    return Picture(
        "multi_horizon",
        "Two horizons in one problem",
        "Seconds first, then blocks to the trip's end. The paper's grid has one mean per block; "
        "ours has up to three stages per block, hard driving, easy driving and braking, each with "
        "its own duration: their places in the block are not known and do not matter.",
        finish(figure, axes, f"{name}: horizon of the QP at one step"),
        data,  # type: ignore[arg-type]
        _concept_chart(study),
    )
