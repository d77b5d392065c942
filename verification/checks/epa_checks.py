"""The plant on EPA's cycles."""

from collections.abc import Iterator

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.epa import (
    AS_FITTED,
    CASES,
    OF_WINTER,
    OFF_EPA,
    TOLERANCE,
    model_mpg,
)

QUICK_CASES = 2


def epa_figures(context: Context) -> Iterator[Check]:
    """Rule-based fuel economy against EPA's dynamometer, and against the plant as fitted.

    With the free engine of the first fit, and with the car that has starts and all of winter;
    `python -m qpmpc.verification.checks.epa` has the default one beside them.
    """
    for case in CASES[:QUICK_CASES] if context.quick else CASES:
        mpg, epa = model_mpg(case), f"EPA {case.epa_mpg:.1f}"
        fitted = f" by {AS_FITTED}, {epa}, when fitted {case.reference_mpg:.1f}"
        of_winter = model_mpg(case, OF_WINTER)
        for car, found_mpg, said in ((f", {OF_WINTER}", of_winter, f", {epa}"), ("", mpg, fitted)):
            yield Check(
                f"EPA, {case.name}{car}",
                "Fuel economy is this close to EPA's dynamometer figure.",
                100.0 * OFF_EPA,
                100.0 * abs(found_mpg / case.epa_mpg - 1.0),
                "%",
                f"{found_mpg:.1f} mpg{said}",
            )
        yield Check(
            f"Plant as fitted, {case.name}",
            "Fuel economy is that of the plant when its free numbers were fitted.",
            100.0 * TOLERANCE,
            100.0 * abs(mpg / case.reference_mpg - 1.0),
            "%",
        )
