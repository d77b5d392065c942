"""The plant on EPA's cycles."""

from collections.abc import Iterator

from qpmpc.vehicle import DEFAULT_VEHICLE
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.epa.figures import (
    AS_FITTED,
    CASES,
    OFF_EPA,
    TOLERANCE,
    model_mpg,
)

QUICK_CASES = 2


def epa_figures(context: Context) -> Iterator[Check]:
    """Rule-based fuel economy against EPA's dynamometer, and against the plant as fitted.

    With the free engine of the first fit, and with the default car.
    """
    for case in CASES[:QUICK_CASES] if context.quick else CASES:
        mpg, fitted = model_mpg(case), f", when fitted {case.reference_mpg:.1f}"
        found = ((DEFAULT_VEHICLE, model_mpg(case, DEFAULT_VEHICLE), ""), (AS_FITTED, mpg, fitted))
        for car, found_mpg, said in found:
            yield Check(
                f"EPA, {case.name}, {car}",
                "Fuel economy is this close to EPA's dynamometer figure.",
                100.0 * OFF_EPA,
                100.0 * abs(found_mpg / case.epa_mpg - 1.0),
                "%",
                f"{found_mpg:.1f} mpg, EPA {case.epa_mpg:.1f}{said}",
            )
        yield Check(
            f"Plant as fitted, {case.name}",
            "Fuel economy is that of the plant when its free numbers were fitted.",
            100.0 * TOLERANCE,
            100.0 * abs(mpg / case.reference_mpg - 1.0),
            "%",
        )
