"""`mh-qp` beside the nonlinear program that it approximates, in closed loop."""

from collections.abc import Iterator

from qpmpc.cycles import cycle_names, load_cycle
from qpmpc.verification.verify.check import Check
from qpmpc.verification.verify.context import Context

FUEL_PERCENT = 0.3
TIME_SHARE = 0.1


def against_the_nonlinear_program(context: Context) -> Iterator[Check]:
    """Both controllers on every shipped cycle, one after the other in this process."""
    from qpmpc.verification.nlp_comparison import compare_closed_loop

    for name in cycle_names():
        both = compare_closed_loop(load_cycle(name), context.vehicle, context.settings)
        qp, nlp = both.qp, both.nlp
        yield Check(
            f"Fuel beside mh-nlp, {name}",
            "SOC-balanced fuel of mh-qp is at most this much above that of the nonlinear program.",
            FUEL_PERCENT,
            both.fuel_difference_percent,
            "%",
            f"{qp['fuel_soc_balanced_g']:.3f} and {nlp['fuel_soc_balanced_g']:.3f} g",
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
            "; ".join(times),
        )
