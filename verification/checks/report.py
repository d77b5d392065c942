"""The HTML report of a verification: one self-contained file."""

from dataclasses import dataclass, field
from typing import Any

from qpmpc.report.html import html_page
from qpmpc.report.provenance import provenance
from qpmpc.verification.checks.check import Check


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


def verification_html(results: Results) -> str:
    """Return the report."""
    return html_page(
        "qpmpc.verification.checks",
        "verify.html.j2",
        results=results,
        figure=figure,
        provenance=provenance(),
    )
