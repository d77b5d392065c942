"""``qpmpc verify``: the losses of the convex model, and the code against its equations.

Each check recomputes its data from the equations (`verification.independent`) and does not call
the function that it checks.
"""

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.checks.groups import Group, run_checks
from qpmpc.verification.checks.report import Results, verification_html

__all__ = ["Check", "Context", "Group", "Results", "run_checks", "verification_html"]
