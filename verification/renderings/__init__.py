"""The QP in numpy, cvxpy and generated C: read out and compared entry by entry."""
