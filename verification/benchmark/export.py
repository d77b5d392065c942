"""Recorded QPs in a documented format, so that others can use them.

``qps_<cycle>.npz`` holds, for n variables, m rows and s steps, in the solver's units:

    min 1/2 z^T diag(hessian) z + q^T z   s.t.   lower <= A z <= upper

- ``a_indices``, ``a_indptr``: the CSC pattern of A, the same in every step
- ``a_data`` (s, nnz), ``hessian`` (s, n), ``q`` (s, n), ``lower`` (s, m), ``upper`` (s, m)
- ``z_start`` (s, n), ``y_start`` (s, m): the controller's warm start

The steps are consecutive: their order makes them a test of warm starting, not only of solving.
"""

from io import BytesIO

import numpy as np

from qpmpc.verification.recorder import Recording


def recorded_npz(recording: Recording) -> bytes:
    """Return the QPs of one run, departure left out, as a compressed npz file."""
    steps = [qp for qp in recording.qps if qp.z is not None][
        -len(recording.run.trajectory.fuel_g) :
    ]
    pattern = recording.structure.matrix_of(steps[0].data.a_data)
    buffer = BytesIO()
    np.savez_compressed(
        buffer,
        a_indices=pattern.indices,
        a_indptr=pattern.indptr,
        a_data=np.array([qp.data.a_data for qp in steps]),
        hessian=np.array([qp.data.hessian for qp in steps]),
        q=np.array([qp.data.q for qp in steps]),
        lower=np.array([qp.data.lower for qp in steps]),
        upper=np.array([qp.data.upper for qp in steps]),
        z_start=np.array([qp.z for qp in steps]),
        y_start=np.array([qp.y for qp in steps]),
    )
    return buffer.getvalue()
