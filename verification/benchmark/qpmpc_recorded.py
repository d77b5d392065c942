"""Recorded QPs of a multi-horizon controller, as a test set for qpbenchmark.

Keep this file beside the ``qps_*.npz`` files that it reads, then, with qpbenchmark 2 installed:

    qpbenchmark --results-path results.csv qpmpc_recorded.py run

It does not need the package that wrote it. The files hold every step of a trip, in order, for
tests of warm starting as well; qpbenchmark starts cold, so one step in `EVERY` is enough for it.
``qps_problem_set.npz`` has degenerate QPs; its infeasible ones are left out here, since
qpbenchmark counts an unsolved QP as a failure.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from qpbenchmark import Problem, TestSet

EVERY = 20


class QpmpcRecorded(TestSet):  # type: ignore[misc]
    """QPs from all files beside this one."""

    @property
    def description(self) -> str:
        """One sentence for the report."""
        return "QPs that a predictive controller of a hybrid car solves, one per second of a trip."

    @property
    def title(self) -> str:
        """Title of the report."""
        return "Multi-horizon MPC of a hybrid car"

    @property
    def sparse_only(self) -> bool:
        """Matrices are sparse: 2 % of A is not zero."""
        return True

    def __iter__(self) -> Iterator[Problem]:
        """Yield the QPs, file by file."""
        for file in sorted(Path(__file__).resolve().parent.glob("qps_*.npz")):
            trip = file.stem.removeprefix("qps_")
            with np.load(file) as stored:
                data = dict(stored)
            if "names" in data:
                for k in np.flatnonzero(data["solvable"]):
                    yield problem(data, int(k), f"{trip}: {data['names'][k]}")
            else:
                for step in range(0, len(data["q"]), EVERY):
                    yield problem(data, step, f"{trip}: step {step}")


def problem(data: Mapping[str, Any], k: int, name: str) -> Problem:
    """1/2 x'Px + q'x  s.t.  G x <= h, A x = b: the sides of lower <= A x <= upper separated."""
    lower, upper, q = data["lower"][k], data["upper"][k], data["q"][k]
    shape = len(lower), len(q)
    a = sp.csc_matrix((data["a_data"][k], data["a_indices"], data["a_indptr"]), shape=shape)
    equal = lower == upper
    above, below = ~equal & np.isfinite(upper), ~equal & np.isfinite(lower)
    return Problem(
        P=sp.diags(data["hessian"][k], format="csc"),
        q=q,
        G=sp.vstack([a[above], -a[below]], format="csc"),
        h=np.concatenate([upper[above], -lower[below]]),
        A=sp.csc_matrix(a[equal]),
        b=upper[equal],
        lb=None,
        ub=None,
        name=name,
    )
