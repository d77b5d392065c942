"""The nonlinear program that the QP approximates, as a controller (CasADi, IPOPT)."""
