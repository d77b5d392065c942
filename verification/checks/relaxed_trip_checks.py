"""The loss by the convex relaxation over a whole trip, with nothing averaged."""

from collections.abc import Iterator

from qpmpc.cycles import load_cycle
from qpmpc.verification.bounds.relaxed_trip import INTEGRAL, relaxed_trip
from qpmpc.verification.checks.bound_checks import optimum_of
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context

CLOSE_PERCENT = 1.0
INTEGRAL_SHARE = 0.99


def relaxed_trip_close(context: Context) -> Iterator[Check]:
    """The relaxed QP of the whole trip at 1 Hz beside dynamic programming."""
    for name in context.cycles:
        relaxed = relaxed_trip(load_cycle(name), context.vehicle)
        optimum = optimum_of(context, name)
        yield Check(
            f"Relaxed trip, {name}",
            "The relaxed QP of the whole trip, curves under-estimated, is this close to dp.",
            CLOSE_PERCENT,
            100.0 * abs(relaxed.fuel_g / optimum.fuel_g - 1.0),
            "%",
            f"{relaxed.fuel_g:.3f} g, dp {optimum.fuel_g:.3f} g; the model's own figure, not a "
            f"proven bound, after {relaxed.rounds} linearisations",
        )
        yield Check(
            f"Relaxed trip integral, {name}",
            f"The on-share of the relaxed trip is within {INTEGRAL:g} of 0 or 1.",
            100.0 * INTEGRAL_SHARE,
            100.0 * relaxed.integral_share,
            "% of seconds",
            at_least=True,
        )
