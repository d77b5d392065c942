"""Solver units: the one place where SI quantities are scaled for the QP solver."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

Floats = NDArray[np.float64]

LARGEST_J = 16e6


class ScalingSettings(BaseModel):
    """Units of the QP's variables.

    Attributes
    ----------
    power_w, fuel_g_per_s, t_cl_k, starts : one solver unit of each quantity; within a factor of
        some thousand of its size, beyond which no solver converges
    energy_j : one solver unit of SOC, as battery energy; in proportion more with a battery of
        more than 16 MJ, see `unit_soc`
    duration_exponent : a stage's rates are counted in units / h^exponent, so that a long stage's
        variables, which weigh more, are resolved finer; 1 makes them energies, 0 plain rates
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    power_w: Annotated[float, Field(ge=10.0, le=10e6)] = 10e3
    fuel_g_per_s: Annotated[float, Field(ge=1e-3, le=1e3)] = 1.0
    energy_j: Annotated[float, Field(ge=40.0, le=40e6)] = 40e3
    t_cl_k: Annotated[float, Field(ge=1e-3, le=1e3)] = 2.0
    starts: Annotated[float, Field(ge=1e-3, le=1e3)] = 0.2
    duration_exponent: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5

    def unit_soc(self, battery_energy_j: float) -> float:
        """One solver unit of SOC; `battery_energy_j` is the energy of a unit of SOC.

        With smaller units the iterations do not get far enough to find, in time, that the charge of
        a plug-in is more than the trip needs: from a full battery NYCC took 29.2 g instead of 21.7.
        """
        return self.energy_j / min(battery_energy_j, LARGEST_J)


@dataclass
class Scaling:
    """Diagonal scaling of one QP: x = D z, rows E A D z, cost c (q^T D z).

    Attributes
    ----------
    column : D, shape (variables,)
    row : E, shape (rows,)
    cost : c
    """

    column: Floats
    row: Floats
    cost: float

    def primal(self, z: Floats) -> Floats:
        """Turn the solver's primal vector into SI units."""
        return z * self.column

    def dual(self, y: Floats) -> Floats:
        """Turn the solver's dual vector into grams of fuel per SI unit of each row."""
        return y * self.row / self.cost

    def solver_primal(self, x: Floats) -> Floats:
        """Turn a primal vector in SI units into the solver's."""
        return x / self.column

    def solver_dual(self, dual: Floats) -> Floats:
        """Turn a dual vector in g per SI unit into the solver's."""
        return dual / self.row * self.cost
