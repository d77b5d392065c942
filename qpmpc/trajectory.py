"""A run second by second."""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.base import Decision
from qpmpc.vehicle.plant import PlantState, StepFlows

Floats = NDArray[np.float64]


@dataclass
class Trajectory:
    """A run second by second; states have one more entry than steps.

    Attributes
    ----------
    soc, t_cl_degc : shape (steps + 1,)
    all others : shape (steps,); `fallback` is the rung used, empty if none; `flags` as of `Flag`;
        the rest as of `Decision`, nan where there is none
    """

    soc: Floats
    t_cl_degc: Floats
    engine_on: NDArray[np.bool_]
    started: NDArray[np.bool_]
    p_eng_w: Floats
    p_bat_w: Floats
    p_friction_w: Floats
    demand_w: Floats
    speed_mps: Floats
    fuel_g: Floats
    coolant_w: Floats
    power_excess_w: Floats
    step_time_s: Floats
    iterations: NDArray[np.int64]
    relaxation_gap: Floats
    on_share: Floats
    flags: NDArray[np.int64]
    certificate_g: Floats
    fallback: list[str]

    @classmethod
    def empty(cls, steps: int) -> Self:
        """Make a trajectory to be filled in step by step."""
        kinds = {"engine_on": bool, "started": bool, "iterations": np.int64, "flags": np.int64}
        arrays: dict[str, Any] = {
            f.name: np.zeros(steps, dtype=kinds.get(f.name, float))
            for f in fields(cls)
            if f.name != "fallback"
        }
        arrays["soc"], arrays["t_cl_degc"] = np.zeros(steps + 1), np.zeros(steps + 1)
        return cls(**arrays, fallback=[""] * steps)

    def store(self, t: int, state: PlantState, flows: StepFlows, decision: Decision) -> None:
        """Record step `t` and the state it led to."""
        self.soc[t + 1], self.t_cl_degc[t + 1] = state.soc, state.t_cl_degc
        self.engine_on[t], self.started[t] = state.engine_on, flows.started
        self.p_eng_w[t], self.p_bat_w[t] = flows.p_eng_w, flows.p_bat_w
        self.p_friction_w[t] = flows.p_friction_w
        self.fuel_g[t], self.coolant_w[t] = flows.fuel_g, flows.coolant_w
        self.power_excess_w[t] = flows.power_excess_w
        self.iterations[t] = decision.iterations
        self.relaxation_gap[t], self.on_share[t] = decision.relaxation_gap, decision.on_share
        self.flags[t], self.fallback[t] = decision.flags, decision.fallback
        self.certificate_g[t] = decision.certificate_g
