"""The result of dynamic programming."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpmpc.vehicle.parameters import Battery

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class DpLevel(NamedTuple):
    """One grid that was solved.

    `fuel_g` is the plant's fuel under its policy, `value_g` the value function at the start;
    `clearance` is the least distance of the trajectory from the edges of the tube
    that are not limits, in half widths (1 for the coarse grid, which has no such edge).
    """

    soc_points: int
    t_cl_points: int
    soc_step: float
    t_cl_step_k: float
    power_step_w: float
    fuel_g: float
    value_g: float
    clearance: float


@dataclass(frozen=True, eq=False)
class DpSolution:
    """Optimal trajectory over n steps, realised on the plant, and its costates.

    With the value function V_k(SOC, T), the least fuel from step k to the end, the costates are

        lambda_SOC = -dV/dSOC [g],    lambda_T = -dV/dT [g/K]:

    fuel saved later by a unit of SOC, or a kelvin of coolant, more now. In the final stretch with
    the engine off only the final-SOC constraint holds the state: lambda_SOC keeps its last value
    (the constraint's multiplier) and lambda_T is zero: the remaining heat has no use.

    Attributes
    ----------
    cycle, vehicle : names
    soc, t_cl_degc : states, shape (n+1,)
    engine_on, p_eng_w, fuel_g : command and fuel of each step, shape (n,)
    soc_costate_g : lambda_SOC, shape (n,)
    soc_efficiency : stored battery energy over the fuel energy it is worth,
        U_oc C_bat / (lambda_SOC LHV), shape (n,), infinite where lambda_SOC is zero
    t_cl_costate_g_per_k : lambda_T, shape (n,)
    heat_costate_g_per_mj : lambda_T over the coolant's heat capacity, shape (n,)
    levels : the grids, coarse first; the last one gave this trajectory
    admissible : whether all limits, the final SOC included, could be kept
    """

    cycle: str
    vehicle: str
    soc: Floats
    t_cl_degc: Floats
    engine_on: Bools
    p_eng_w: Floats
    fuel_g: Floats
    soc_costate_g: Floats
    soc_efficiency: Floats
    t_cl_costate_g_per_k: Floats
    heat_costate_g_per_mj: Floats
    levels: tuple[DpLevel, ...]
    admissible: bool

    @property
    def fuel_total_g(self) -> float:
        """Fuel of the trajectory on the plant, g; an upper bound of the least possible."""
        return float(self.fuel_g.sum())

    @property
    def value_g(self) -> float:
        """Fuel by the value function at the start, g; biased upwards by interpolation."""
        return self.levels[-1].value_g

    @property
    def gap_g(self) -> float:
        """Value function minus realised fuel, g: the size of the interpolation error."""
        return self.value_g - self.fuel_total_g

    @property
    def converged(self) -> bool:
        """Whether the trajectory stays clear of the tube's edges."""
        return self.levels[-1].clearance >= CLEARANCE

    def soc_price_g(self, battery: Battery) -> float | None:
        """Fuel that a unit of final SOC is worth; None of a trip that is not admissible.

        The median of lambda_SOC since SOC was last at a limit, where it jumps: the derivative of
        the least fuel to the SOC asked for at arrival. In the last seconds alone, with few choices
        left, lambda_SOC is off by some percent.
        """
        if not self.admissible:
            return None
        soc = self.soc[:-1]
        at_limit = (soc < battery.soc_min + AT_LIMIT) | (soc > battery.soc_max - AT_LIMIT)
        at_limit[-1] = False  # of a trip that ends there
        since = int(np.flatnonzero(at_limit)[-1]) + 1 if at_limit.any() else 0
        return max(float(np.median(self.soc_costate_g[since:])), 0.0)


AT_LIMIT = 0.005  # of SOC
CLEARANCE = 0.15
