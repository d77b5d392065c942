"""One check: the claim, the measured value, and whether the claim holds."""

from dataclasses import dataclass
from math import isfinite, nan
from typing import Any


@dataclass(frozen=True)
class Check:
    """Result of one check; it passes if the measured value is finite and within the tolerance.

    Attributes
    ----------
    name : short, unique
    claim : the requirement, in one sentence
    tolerance : largest allowed value
    measured : the value found
    unit : of both; empty for plain numbers
    detail : anything that a reader needs to judge the figure
    at_least : the tolerance is the least allowed value
    skipped : it could not be run on this machine, for the reason in `detail`
    """

    name: str
    claim: str
    tolerance: float
    measured: float
    unit: str = ""
    detail: str = ""
    at_least: bool = False
    skipped: bool = False

    @property
    def passed(self) -> bool:
        """Whether the claim holds, as far as it was tested."""
        if self.skipped:
            return True
        if not isfinite(self.measured):
            return False
        if self.at_least:
            return self.measured >= self.tolerance
        return self.measured <= self.tolerance

    @property
    def share(self) -> float:
        """Share of the tolerance that is used, 1 at its end; nan without a size of either."""
        found, allowed = abs(self.measured), abs(self.tolerance)
        if self.at_least:
            found, allowed = allowed, found
        return found / allowed if allowed > 0.0 and isfinite(found) else nan

    @property
    def verdict(self) -> str:
        """`pass`, `FAIL` or `skipped`."""
        if self.skipped:
            return "skipped"
        return "pass" if self.passed else "FAIL"

    def summary(self) -> dict[str, Any]:
        """Return plain data, ready for JSON; a value that is not finite is null."""
        return {
            "name": self.name,
            "claim": self.claim,
            "tolerance": self.tolerance,
            "relation": ">=" if self.at_least else "<=",
            "measured": self.measured if isfinite(self.measured) else None,
            "unit": self.unit,
            "verdict": self.verdict,
            "detail": self.detail,
        }
