"""Dynamic programming: the least fuel that the plant can burn on a cycle.

    min sum_k fuel_k   over engine off, or on with power P_eng, in every second k = 0..n-1
    subject to the plant (paper eqs. 1-5), SOC_min <= SOC_k <= SOC_max,
    T_min <= T_cl,k <= T_max, the power limits of engine and battery, SOC_n >= SOC_0

solved by Bellman's recursion over (SOC, T_cl) and realised on the plant. Method, error and
measured convergence: docs/dynamic_programming.md. Needs the extra ``verification`` (numba).
"""

from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solution import DpLevel, DpSolution
from qpmpc.verification.dynamic_programming.solve_dp import Progress, convergence_study, solve_dp

__all__ = ["DpLevel", "DpSettings", "DpSolution", "Progress", "convergence_study", "solve_dp"]
