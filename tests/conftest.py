"""One thread of linear algebra for each of the processes in which the tests run side by side.

Two on two cores wait for each other: the solvers' tests take a quarter more processor time.
"""

import os

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(threads, "1")  # read where numpy is imported, later than this
