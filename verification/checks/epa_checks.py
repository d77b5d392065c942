"""The plant on EPA's cycles."""

from collections.abc import Iterator

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.epa import AS_FITTED, CASES, TOLERANCE, model_mpg

OFF_EPA = 0.05
QUICK_CASES = 2


def epa_figures(context: Context) -> Iterator[Check]:
    """Rule-based fuel economy against EPA's dynamometer, and against the plant as fitted.

    Both with the free engine of the fit; `python -m qpmpc.verification.checks.epa` has the default
    one beside it.
    """
    for case in CASES[:QUICK_CASES] if context.quick else CASES:
        mpg = model_mpg(case)
        yield Check(
            f"EPA, {case.name}",
            "Fuel economy is this close to EPA's dynamometer figure.",
            100.0 * OFF_EPA,
            100.0 * abs(mpg / case.epa_mpg - 1.0),
            "%",
            f"{mpg:.1f} mpg by {AS_FITTED}, EPA {case.epa_mpg:.1f}, when fitted "
            f"{case.reference_mpg:.1f}",
        )
        yield Check(
            f"Plant as fitted, {case.name}",
            "Fuel economy is that of the plant when its free numbers were fitted.",
            100.0 * TOLERANCE,
            100.0 * abs(mpg / case.reference_mpg - 1.0),
            "%",
        )
