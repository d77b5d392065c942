"""QPs in a documented format, so that others can use them.

``qps_<cycle>.npz`` holds, for n variables, m rows and s steps, in the solver's units:

    min 1/2 z^T diag(hessian) z + q^T z   s.t.   lower <= A z <= upper

- ``a_indices``, ``a_indptr``: the CSC pattern of A, the same in every step
- ``a_data`` (s, nnz), ``hessian`` (s, n), ``q`` (s, n), ``lower`` (s, m), ``upper`` (s, m)
- ``z_start`` (s, n), ``y_start`` (s, m): the controller's warm start

The steps are consecutive: their order makes them a test of warm starting, not only of solving.

``qps_problem_set.npz`` holds the common problem set in the same way; instead of the warm starts
it has ``names``, ``kinds`` and ``solvable``, each (s,).

``qpmpc_recorded.py``, written beside them, turns all of them into a test set for qpbenchmark.
"""

from collections.abc import Sequence
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from qpmpc.files import write_bytes, write_text
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.verification.problems.problem_set import Problem
from qpmpc.verification.problems.recorder import Recording

TEST_SET = "qpmpc_recorded.py"


def write_qps(recordings: Sequence[Recording], problems: Sequence[Problem], folder: Path) -> None:
    """Write the QPs of some runs and the problem set, with the test set that reads them."""
    for recording in recordings:
        write_bytes(folder / f"qps_{recording.run.cycle}.npz", recorded_npz(recording))
    write_bytes(folder / "qps_problem_set.npz", problem_set_npz(problems))
    source = files("qpmpc.verification.benchmark").joinpath(TEST_SET)
    write_text(folder / TEST_SET, source.read_text("utf-8"))


def recorded_npz(recording: Recording) -> bytes:
    """Return the QPs of one run, departure left out, as a compressed npz file."""
    steps = recording.on_the_road
    return _npz(
        recording.structure,
        [qp.data for qp in steps],
        z_start=np.array([qp.primal for qp in steps]),
        y_start=np.array([qp.dual for qp in steps]),
    )


def problem_set_npz(problems: Sequence[Problem]) -> bytes:
    """Return the problem set as a compressed npz file.

    Raises
    ------
    ValueError
        If the problems do not share one pattern.
    """
    structure = problems[0].structure
    if any(p.structure.shape != structure.shape for p in problems):
        raise ValueError("problems of different sizes")
    return _npz(
        structure,
        [p.data for p in problems],
        names=np.array([p.name for p in problems]),
        kinds=np.array([p.kind for p in problems]),
        solvable=np.array([p.kind != "infeasible" for p in problems]),
    )


def _npz(structure: QpStructure, qps: Sequence[QpData], **more: Any) -> bytes:
    pattern = structure.matrix_of(qps[0].a_data)
    buffer = BytesIO()
    np.savez_compressed(
        buffer,
        a_indices=pattern.indices,
        a_indptr=pattern.indptr,
        a_data=np.array([qp.a_data for qp in qps]),
        hessian=np.array([qp.hessian for qp in qps]),
        q=np.array([qp.q for qp in qps]),
        lower=np.array([qp.lower for qp in qps]),
        upper=np.array([qp.upper for qp in qps]),
        **more,
    )
    return buffer.getvalue()
