"""What a plan costs when it is driven on the exact maps, whatever it predicted of itself."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.trip import Observation
from qpmpc.verification.nonlinear.problem import (
    ROAD,
    SIGMA_LEAST,
    THERMOSTAT_STEPS,
    NlpProblem,
    NlpVar,
)

Floats = NDArray[np.float64]

ROUNDS = 4  # SOC and coolant at a stage's end are in its means: each round errs a hundredth as much


@dataclass(frozen=True)
class DrivenPlan:
    """Outcome of a plan on the exact maps.

    Attributes
    ----------
    fuel_g : to arrival, with that of the starts
    soc_end, t_cl_end_degc : at arrival
    """

    fuel_g: float
    soc_end: float
    t_cl_end_degc: float


class PlanDriver:
    """Drives plans through the stages of a nonlinear program.

    A plan after a fixed number of iterations fulfils its equations to its residuals only, and those
    of the QP are linearised: fuel that it predicts is of another SOC at arrival than it predicts.
    Driven from stage to stage by the exact maps, on-shares and powers of any plan have a fuel and a
    SOC that belong together.

    Parameters
    ----------
    problem : whose stages are driven
    """

    def __init__(self, problem: NlpProblem) -> None:
        self._problem = problem
        self._second, self._block = problem.stage(1), problem.stage(THERMOSTAT_STEPS)

    def drive(
        self, stages: Stages, seen: Observation, on_share: Floats, power_w: Floats
    ) -> DrivenPlan:
        """Drive a plan.

        Parameters
        ----------
        stages, seen : horizon and state that it is for
        on_share : share of each stage with the engine on, shape (n,); cut to 0..1
        power_w : engine power, mean over the stage, shape (n,); cut to what a running engine can
        """
        problem = self._problem
        data = problem.data(stages, seen.soc, seen.t_cl_degc, seen.engine_on)
        road = data.parameters[: problem.stages * ROAD].reshape(problem.stages, ROAD)
        state, before = np.array([seen.soc, seen.t_cl_degc]), float(seen.engine_on)
        fuel_g = 0.0
        for k in np.flatnonzero(stages.duration_s > 0.0).tolist():
            least_w, most_w, rises = road[k, 5:8]
            x = np.zeros(problem.count)
            x[[NlpVar.SOC, NlpVar.T_CL]] = state
            x[NlpVar.ON] = sigma = float(np.clip(on_share[k], SIGMA_LEAST, 1.0))
            x[NlpVar.ABOVE] = np.clip(power_w[k] / sigma, least_w, most_w) * sigma - least_w * sigma
            starts = max(rises * (sigma - before), 0.0)
            if problem.count > NlpVar.START:
                x[NlpVar.START] = starts
            stage_g = self._stage(
                self._second if k < problem.short_stages else self._block, state, x, road[k]
            )
            fuel_g += stage_g + problem.vehicle.engine.start_fuel_g * starts
            state, before = x[[NlpVar.SOC, NlpVar.T_CL]], sigma
        return DrivenPlan(fuel_g, float(state[0]), float(state[1]))

    @staticmethod
    def _stage(stage: Any, before: Floats, x: Floats, road: Floats) -> float:
        """Fuel of a stage, g; SOC and coolant at its end are written into `x`."""
        fuel_g = 0.0
        for _ in range(ROUNDS):
            fuel, soc_gain, t_cl_gap = stage(before, x, road)
            x[NlpVar.SOC] += float(soc_gain)
            x[NlpVar.T_CL] += float(t_cl_gap)
            fuel_g = float(fuel)
        return fuel_g
