"""``qpmpc verify``: what the convex model loses, and whether the code is the mathematics claimed.

Each check recomputes what it needs from the equations (`verification.independent`) and does not
call the function that it checks.
"""

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.groups import Group, run_checks
from qpmpc.verification.checks.report import Results, verification_html

__all__ = ["Check", "Context", "Group", "Results", "run_checks", "verification_html"]
