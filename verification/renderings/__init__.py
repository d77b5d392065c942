"""The QP in numpy, cvxpy, CasADi and generated C: read out and compared entry by entry."""
