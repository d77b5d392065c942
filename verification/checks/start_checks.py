"""The QP, its renderings and the lower bound on fuel, for an engine whose starts cost something."""

from collections.abc import Iterator
from dataclasses import replace

from qpmpc.vehicle import load_vehicle
from qpmpc.verification.checks.bound_checks import bound_below_everything
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.qp_checks import same_optimum, stages_agree, warm_start_shifted
from qpmpc.verification.checks.rendering_checks import generated_c, one_qp

STARTS: dict[str, object] = {"engine.start_fuel_g": 0.2, "engine.start_energy_j": 4000.0}
CHECKS = (
    stages_agree,
    same_optimum,
    warm_start_shifted,
    one_qp,
    generated_c,
    bound_below_everything,
)


def with_starts(context: Context) -> Iterator[Check]:
    """Checks again, on NYCC with 4 kJ of cranking a start besides its fuel."""
    starting = Context(True, load_vehicle().with_settings(STARTS))
    starting.settings = context.settings
    for check in CHECKS:
        for found in check(starting):
            yield replace(found, name=f"{found.name}, starts cost")
