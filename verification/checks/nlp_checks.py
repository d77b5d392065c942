"""`mh-qp` beside the nonlinear program that it approximates: plan by plan, and run by run."""

from collections.abc import Iterator
from typing import Any

from qpmpc.cycles import cycle_names
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context

EVERY = 15  # steps from one state compared to the next
# Allowed cost of a fixed number of iterations, the PWA curves and the expansion of alpha(T) F
# together. Near the optimum the cost is flat: plans differ more than their fuel.
SAME_ON_OFF_PERCENT = 90.0
FIRST_POWER_W = 1000.0  # of some 10 kW while the engine runs
SOC = 0.05  # of the 0.4 that the battery may use
SOC_END = 0.002  # what the residuals of a fixed number of iterations leave
T_CL_K = 3.0  # of the 50 between the coolant's limits
PLANNED_FUEL_PERCENT = 0.3

FUEL_PERCENT = 0.3
TIME_SHARE = 0.1


def plans_beside_the_nonlinear_program(context: Context) -> Iterator[Check]:
    """Both plans from the same states along closed loops of `mh-qp`."""
    from qpmpc.verification.nonlinear.comparison import compare_open_loop

    for name in context.cycles if context.quick else cycle_names():
        found = compare_open_loop(context.trip(name), EVERY, context.settings)
        states = f"{len(found.pairs)} states"
        yield Check(
            f"States without a plan of mh-nlp, {name}",
            "IPOPT solves the nonlinear program to its tolerance in every state.",
            0.0,
            float(found.nlp_unsolved),
            "states",
            f"of {len(found.pairs) + found.nlp_unsolved}",
        )
        if not found.pairs:
            continue
        result = found.summary()
        yield Check(
            f"First command, on or off, {name}",
            "Both programs plan the engine on, or both plan it off, in the second ahead.",
            SAME_ON_OFF_PERCENT,
            100.0 * result["same_on_off_share"],
            "% of states",
            states,
            at_least=True,
        )
        for title, claim, key, of, tolerance, unit in (
            (
                "First command, power",
                "In the mean over states, both programs plan the same first engine power.",
                "first_power_w",
                "mean",
                FIRST_POWER_W,
                "W",
            ),
            (
                "Predicted SOC",
                "In 95 % of states both predict the same SOC at the end of every stage.",
                "soc",
                "p95",
                SOC,
                "",
            ),
            (
                "SOC at arrival",
                "In 95 % of states both plan to arrive with the same SOC.",
                "soc_end",
                "p95",
                SOC_END,
                "",
            ),
            (
                "Predicted T_cl",
                "In 95 % of states both predict the same coolant while fuel is burnt.",
                "t_cl_k",
                "p95",
                T_CL_K,
                "K",
            ),
            (
                "Planned fuel",
                "In 95 % of states both plans, driven on the exact maps, burn the same to arrival.",
                "planned_fuel_percent",
                "p95",
                PLANNED_FUEL_PERCENT,
                "%",
            ),
        ):
            spread = result[key]
            figures = ", ".join(f"{word} {value:.2g}" for word, value in spread.items())
            detail = f"{states}; absolute difference: {figures}"
            yield Check(f"{title}, {name}", claim, tolerance, spread[of], unit, detail)


def against_the_nonlinear_program(context: Context) -> Iterator[Check]:
    """Both controllers on every shipped cycle, one after the other in this process."""
    from qpmpc.verification.nonlinear.comparison import compare_closed_loop

    for name in cycle_names():
        both = compare_closed_loop(context.trip(name), context.settings)
        qp, nlp = both.qp, both.nlp
        yield Check(
            f"Fuel beside mh-nlp, {name}",
            "SOC-balanced fuel of mh-qp is at most this much above that of the nonlinear program.",
            FUEL_PERCENT,
            both.fuel_difference_percent,
            "%",
            f"{qp['fuel_soc_balanced_g']:.3f} and {nlp['fuel_soc_balanced_g']:.3f} g; "
            f"{_excess(qp)} and {_excess(nlp)}",
        )
        times = [
            f"{key} {qp['step_time_ms'][key]:.2f} and {nlp['step_time_ms'][key]:.2f} ms"
            for key in ("median", "max")
        ]
        yield Check(
            f"Time beside mh-nlp, {name}",
            "A step of mh-qp takes at most this share of the nonlinear program's time, in median.",
            TIME_SHARE,
            both.time_ratio["median"],
            "",
            "; ".join([*times, f"{qp['solver']['name']} and {nlp['solver']['name']}"]),
        )


def _excess(run: dict[str, Any]) -> str:
    over = [f"{key} {value:.3g}" for key, value in run["violations"].items() if value]
    return f"limits exceeded by {', '.join(over)}" if over else "no limit exceeded"
