"""The HTML report of a verification: one self-contained file."""

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from qpmpc.report.html import html_page
from qpmpc.report.provenance import provenance
from qpmpc.verification.checks.check import Check

NEAREST = 10  # checks shown that come nearest to their tolerance


@dataclass
class Results:
    """Checks by group, in order.

    Attributes
    ----------
    quick : whether the quick checks only
    groups : title and checks
    seconds : wall time of each group
    """

    quick: bool
    groups: list[tuple[str, list[Check]]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def checks(self) -> list[Check]:
        """All checks."""
        return [check for _, checks in self.groups for check in checks]

    @property
    def passed(self) -> bool:
        """Whether all claims hold."""
        return all(check.passed for check in self.checks)

    def summary(self) -> dict[str, Any]:
        """Return plain data, ready for JSON."""
        return {
            "quick": self.quick,
            "passed": self.passed,
            "checks": [
                {"group": title, **check.summary()}
                for title, checks in self.groups
                for check in checks
            ],
            "seconds": sum(self.seconds),
        }


def figure(value: float) -> str:
    """Three significant digits."""
    return f"{value:.3g}"


def verification_answer(results: Results) -> list[str]:
    """Return whether the claims hold, which do not, and how far that was tested."""
    checks = results.checks
    failed = [check.name for check in checks if not check.passed]
    skipped = [check.name for check in checks if check.skipped]
    held = len(checks) - len(failed) - len(skipped)
    if not held and not failed:
        first = "Nothing was tested."
    elif failed:
        first = f"{len(failed)} of {len(checks)} checks failed: {', '.join(failed)}."
    else:
        first = f"All claims that were tested hold: {held}."
    sentences = [first]
    if failed:
        sentences.append(f"{held} hold.")
    if skipped:
        sentences.append(f"Not tested on this machine: {', '.join(skipped)}.")
    sentences.append("Quick run: fewer cycles and samples." if results.quick else "Full run.")
    return [*sentences, f"It took {sum(results.seconds):.0f} s."]


def nearest_checks(results: Results) -> list[tuple[str, Check]]:
    """Return group and check of all that failed, then of those that use most of their tolerance."""
    found = [(title, check) for title, checks in results.groups for check in checks]
    failed = [each for each in found if not each[1].passed]
    others = [e for e in found if e[1].passed and not e[1].skipped and isfinite(e[1].share)]
    others.sort(key=lambda each: -each[1].share)
    return [*failed, *others[:NEAREST]]


def verification_html(results: Results) -> str:
    """Return the report."""
    return html_page(
        "qpmpc.verification.checks",
        "verify.html.j2",
        title="Verification",
        answer=verification_answer(results),
        results=results,
        nearest=nearest_checks(results),
        figure=figure,
        provenance=provenance(),
    )
