"""The table's quantities and expressions in numpy, for all stages at once."""

import ast
from collections.abc import Mapping
from functools import partial
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel
from qpmpc.qp import rows
from qpmpc.qp.coolant import thermostat_step
from qpmpc.qp.coolant_floor import CoolantFloor
from qpmpc.qp.expressions import code_of, names_in, parsed, targets_of
from qpmpc.qp.linearisation import Linearisation
from qpmpc.vehicle import heat
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

# Changing from step to step: a stage, the point it is expanded about, the state now.
STAGE = (
    "duration_s",
    "net_w",
    "speed_mps",
    "internal_off_w",
    "must_share",
    "free_net_w",
    "free_internal_off_w",
    "rises",
    "fall_j",
    "rise_j",
    "refill_j",
)
ABOUT = ("t_cl_degc", "fuel_g_per_s", "p_eng_w", "t_cl_start_degc", "t_cl_end_degc")
FLOOR = ("floor_degc", "highest_floor_degc")
INPUTS = (*STAGE, *(f"about_{name}" for name in ABOUT), "start_soc", "on_now", *FLOOR)
ORIGIN = ("origin_soc", "origin_t_cl_degc")


def pieces_of(model: PwaModel) -> dict[str, Floats]:
    """Slopes and intercepts of the curves whose pieces make rows; shape (pieces,) each."""
    return {
        "fuel_slope": model.fuel.slope,
        "fuel_intercept": model.fuel.intercept,
        "battery_slope": model.battery.slope,
        "battery_intercept": model.battery.intercept,
    }


LEARNED = ("fuel_slope", "fuel_intercept", "fuel_idle_g_per_s", "fuel_chord_g_per_j")


def fuel_chord(fuel: PwaFit, power_max_w: float) -> dict[str, float]:
    """Chord of the fuel curve, from idling to full power."""
    idle, full = map(float, fuel(np.array([0.0, power_max_w])))
    return {"fuel_idle_g_per_s": idle, "fuel_chord_g_per_j": (full - idle) / power_max_w}


class Quantities:
    """Evaluates expressions of the table; constant ones are evaluated once.

    Arrays have shape (n, 1), one row per stage, or (1, pieces) and (n, pieces) in rows of a curve.

    Parameters
    ----------
    parameters : numbers by name, see `qp_parameters`
    vehicle, model : of the plant and of the PWA curves
    stages : n
    learning : whether the fuel curve changes from step to step, too
    """

    def __init__(
        self,
        parameters: Mapping[str, float],
        vehicle: Vehicle,
        model: PwaModel,
        stages: int,
        learning: bool = False,
    ) -> None:
        thermal, least = vehicle.thermal, parameters["t_min_degc"]
        self._floor = CoolantFloor(vehicle, model.line, parameters["battery_energy_j"], least)
        losses = heat.in_arithmetic(min=np.minimum, max=np.maximum)
        is_last = np.zeros((stages, 1))
        is_last[-1] = 1.0
        self._names: dict[str, Any] = {
            **{name: value for name, value in vars(rows).items() if name.isupper()},
            **parameters,
            **{name: values[None, :] for name, values in pieces_of(model).items()},
            **{f.__name__: partial(losses[f.__name__], thermal) for f in heat.FUNCTIONS},
            **dict.fromkeys(ORIGIN, 0.0),
            "is_last": is_last,
            "min": np.minimum,
            "max": np.maximum,
            "where": np.where,
            "running": partial(np.cumsum, axis=0),
            "pwa_alpha": model.alpha,
            "pwa_alpha_slope": model.alpha.active_slope,
            "pwa_battery": model.battery,
            "thermostat_step": partial(thermostat_step, thermal),
        }
        self._changing = {*INPUTS, *(LEARNED if learning else ())}
        each_step: list[ast.stmt] = []
        for line in parsed(rows.QUANTITIES):
            if self.is_changing(line):
                each_step.append(line)
                self._changing.update(targets_of(line))
            else:
                exec(code_of([line]), self._names)
        self._each_step = code_of(each_step)

    def of_stages(self) -> set[str]:
        """Return the names of numbers, and of what has one value per stage."""
        numbers = {name for name, value in self._names.items() if isinstance(value, float)}
        return (numbers | self._changing) - set(LEARNED)

    def is_changing(self, formula: ast.AST) -> bool:
        """Whether a formula's value changes from step to step."""
        return not self._changing.isdisjoint(names_in(formula))

    def update(
        self, stages: Stages, soc: float, about: Linearisation, engine_on: bool
    ) -> dict[str, Any]:
        """Evaluate all quantities for a horizon, and return them by name."""
        names = self._names
        for name in STAGE:
            names[name] = getattr(stages, name)[:, None]
        for name in ABOUT:
            names[f"about_{name}"] = getattr(about, name)[:, None]
        floor = self._floor.at(stages, soc)
        names["on_now"] = np.zeros((len(stages.duration_s), 1))
        names["on_now"][0] = engine_on
        names["start_soc"], names["floor_degc"] = soc, floor[:, None]
        names["highest_floor_degc"] = floor.max()
        exec(self._each_step, names)
        return names

    def learn(self, fuel: PwaFit, power_max_w: float) -> None:
        """Take another fuel curve."""
        self._names |= fuel_chord(fuel, power_max_w)
        self._names["fuel_slope"] = fuel.slope[None, :]
        self._names["fuel_intercept"] = fuel.intercept[None, :]

    def value(self, code: CodeType) -> Any:
        """Evaluate an expression with the values of the last update."""
        return eval(code, self._names)
