"""The promise of the safety layer, against every command of a second."""

from collections.abc import Iterator

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.safety.promise import promise

QUICK_CARS, FULL_CARS, SEED = 20, 400, 11
ROUNDING_W, ROUNDING_SOC, ROUNDING_K = 1e-6, 1e-12, 1e-9


def no_command_is_safer(context: Context) -> Iterator[Check]:
    """No command exceeds the limits of the next second by less than the layer's."""
    found = promise(QUICK_CARS if context.quick else FULL_CARS, SEED)
    detail = (
        f"{found.seconds} random seconds of random cars, every limit kept in {found.kept} of them"
    )
    for name, excess, tolerance, unit in (
        ("power", found.power_w, ROUNDING_W, "W"),
        ("SOC", found.soc, ROUNDING_SOC, ""),
        ("coolant", found.t_cl_k, ROUNDING_K, "K"),
    ):
        yield Check(
            f"Safety layer, {name}",
            f"No command exceeds the {name} limits of the next second by less, among those that "
            "exceed the limits of higher priority by no more.",
            tolerance,
            excess,
            unit,
            detail,
        )
    yield Check(
        "Safety layer, range",
        "No command asks for more power than the engine and its ramp allow.",
        ROUNDING_W,
        found.beyond_w,
        "W",
        detail,
    )
    yield Check(
        "Safety layer, shortest run and rest",
        "No run or rest of the engine ends too early where going on keeps all limits and margins.",
        0.0,
        float(found.cut_short),
        "seconds",
        f"{found.held} seconds in which ending it was wished",
    )
