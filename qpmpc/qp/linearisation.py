"""Where the two nonlinear terms of the coolant, alpha(T) F and the thermostat, are expanded."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.horizon import HorizonSettings
from qpmpc.qp.rows import Var

Floats = NDArray[np.float64]

COLDEST_DEGC, HOTTEST_DEGC = 0.0, 100.0  # where a linearisation point may lie
DEPARTURE_FUEL_G_PER_S, DEPARTURE_P_ENG_W = 0.3, 4000.0  # where there is no plan yet


@dataclass(frozen=True)
class Linearisation:
    """Point about which the coolant's row and the cost are expanded; shape (n,) each.

    Attributes
    ----------
    t_cl_degc : T^, coolant temperature at which alpha is taken
    fuel_g_per_s : F^, mean nominal fuel rate
    p_eng_w : E^, mean engine power
    t_cl_start_degc, t_cl_end_degc : coolant temperature at the ends of the stage
    """

    t_cl_degc: Floats
    fuel_g_per_s: Floats
    p_eng_w: Floats
    t_cl_start_degc: Floats
    t_cl_end_degc: Floats

    @classmethod
    def constant(
        cls,
        stages: int,
        t_cl_degc: float,
        fuel_g_per_s: float = DEPARTURE_FUEL_G_PER_S,
        p_eng_w: float = DEPARTURE_P_ENG_W,
    ) -> "Linearisation":
        """Return the same point for all of n stages: where there is no plan yet."""
        t_cl = np.full(stages, t_cl_degc)
        return cls(t_cl, np.full(stages, fuel_g_per_s), np.full(stages, p_eng_w), t_cl, t_cl)

    def towards(self, x: Floats, part: float) -> Floats:
        """Return a plan whose columns that make a point are moved that part of the way from here.

        Parameters
        ----------
        x : solution, SI units, shape (n, variables)
        part : 1 returns the plan itself
        """
        of = {
            Var.T_CL: self.t_cl_end_degc,
            Var.FUEL: self.fuel_g_per_s,
            Var.P_ENG: self.p_eng_w,
        }
        moved = x.copy()
        for column, here in of.items():
            moved[:, column] = (1.0 - part) * here + part * x[:, column]
        return moved

    @classmethod
    def about(cls, x: Floats, t_cl_degc: float, layout: HorizonSettings) -> "Linearisation":
        """Return the point that a plan gives.

        T^ is the mean of a stage's own ends, for demand classes that of their block's: the class
        driven first in the plan is in reality spread over the block, and driven at the block's
        temperature.

        Parameters
        ----------
        x : solution, SI units, shape (n, variables)
        t_cl_degc : coolant temperature at the start of the first stage
        layout : of the stages
        """
        end = np.clip(x[:, Var.T_CL], COLDEST_DEGC, HOTTEST_DEGC)
        start = np.concatenate([[np.clip(t_cl_degc, COLDEST_DEGC, HOTTEST_DEGC)], end[:-1]])
        mean = 0.5 * (start + end)
        n, classes = layout.short_stages, layout.classes
        mean[n:] = np.repeat(0.5 * (start[n::classes] + end[n + classes - 1 :: classes]), classes)
        fuel, p_eng = np.maximum(x[:, Var.FUEL], 0.0), np.maximum(x[:, Var.P_ENG], 0.0)
        return cls(mean, fuel, p_eng, start, end)
