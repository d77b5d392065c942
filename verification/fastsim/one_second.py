"""FASTSim 3.1 driven second by second, which it does not offer itself.

Its `run_once` drives a whole cycle. Here it drives a cycle of two samples, with a vehicle rebuilt
each time from plain data in which only `CARRIED` has changed: all that FASTSim reads of the second
before. Feeding back the whole state ends in a segmentation fault, and `run` resets SOC. Stepped
like this it repeats its own whole run bit by bit (tests/verification/test_fastsim.py).
"""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import fastsim

from qpmpc.cycles import Cycle
from qpmpc.errors import QpmpcError
from qpmpc.vehicle.plant import Command

Tree = dict[str, Any]


@dataclass(frozen=True)
class Model:
    """A car that FASTSim ships.

    Attributes
    ----------
    plant : its name as our plant, which is also that of its own control
    believed : what controllers believe in
    car : what it is, in words
    file : FASTSim's
    heated : whether it has an engine that warms up, a cabin heated by it and a battery that warms
    """

    plant: str
    believed: str
    car: str
    file: str
    heated: bool


PRIUS = Model(
    "fastsim",
    "prius-fastsim",
    "2016 Prius Two",
    "2016_TOYOTA_Prius_Two.yaml",
    heated=False,
)
SONATA = Model(
    "fastsim-sonata",
    "sonata-fastsim",
    "2021 Sonata Hybrid Blue",
    "2021_Hyundai_Sonata_Hybrid_Blue_thrml.yaml",
    heated=True,
)

# Where the parts of a car stand in its data.
_HYBRID = ("pt_type", "HEV")
PLACES: dict[str, tuple[str, ...]] = {
    "vehicle": (),
    **{name: (*_HYBRID, name) for name in ("fc", "em", "res", "transmission", "pt_cntrl")},
    "sim_params": (*_HYBRID, "sim_params"),
    "fc_heat": (*_HYBRID, "fc", "thrml", "FuelConverterThermal"),
    "res_heat": (*_HYBRID, "res", "thrml", "RESLumpedThermal"),
    "cabin": ("cabin", "LumpedCabin"),
    "hvac": ("hvac", "LumpedCabin"),
}
CARRIED = {
    "vehicle": ("speed_ach_meters_per_second", "pwr_tractive_watts"),
    "fc": (
        "pwr_prop_watts",
        "pwr_aux_watts",
        "pwr_out_max_watts",
        "fc_on",
        "time_on_seconds",
    ),
    "em": ("pwr_mech_fwd_out_max_watts",),
    "res": ("soc",),
}
# Of a heated car: what the engine burnt warms it in the second after.
CARRIED_HEAT = {
    "vehicle": ("elev_curr_meters",),  # the air by which the cabin cools
    "fc": ("pwr_fuel_watts",),
    "fc_heat": ("temperature_kelvin",),
    "res": ("eff", "pwr_out_electrical_watts"),
    "res_heat": ("temperature_kelvin", "temp_prev_kelvin"),
    "cabin": ("temperature_kelvin", "temp_prev_kelvin"),
    "hvac": ("pwr_i_watts",),
}
# Its rule-based control without rules: no power held back for the road ahead, no shortest run, and
# the engine on where the speed is above one that is always, or never, exceeded.
NO_RULES = {
    "speed_soc_disch_buffer_coeff": 0.0,
    "speed_soc_regen_buffer_coeff": 0.0,
    "speed_soc_fc_on_buffer_coeff": 0.0,
    "fc_min_time_on_seconds": 0.0,
    "frac_pwr_demand_fc_forced_on": 1e9,
}
# Nor does a cold engine run for its heat.
NO_RULES_OF_HEAT = {"temp_fc_forced_on_kelvin": 0.0, "temp_fc_allowed_off_kelvin": 0.0}
ON_ABOVE = "speed_fc_forced_on_meters_per_second"
ALWAYS_MPS, NEVER_MPS = -1.0, 1e9
# The engine gives the share of its most efficient power that this says, or what the motor cannot.
POWER_SHARE = "frac_of_most_eff_pwr_to_run_fc"
ZERO_DEGC_K = 273.15
# With these of the second before, no demand calls for the engine.
NO_DEMAND = {"vehicle": ("pwr_tractive_watts", 0.0), "em": ("pwr_mech_fwd_out_max_watts", 1e9)}


def shipped_car(model: Model) -> Tree:
    """Return a car of FASTSim as plain data that can be driven."""
    car = fastsim.Vehicle.from_resource(model.file)
    car.set_save_interval(None)  # no history
    return dict(car.to_dict())


def parameters(model: Model) -> Tree:
    """Return the same car to be read: its curves are lists, ``{"grid": [x], "values": y}``."""
    return dict(fastsim.Vehicle.from_resource(model.file).to_dict(data_fmt="json"))


def component(car: Tree, name: str) -> Tree:
    """Return a part of a car: engine ``fc``, motor ``em``, battery ``res``, .., see `PLACES`."""
    part = car
    for key in PLACES[name]:
        part = part[key]
    return part


def best_power_w(car: Tree) -> float:
    """Engine power of the greatest efficiency, the first of several; of `parameters`."""
    engine = component(car, "fc")
    curve = engine["eff_interp_from_pwr_out"]["data"]
    best = curve["values"].index(max(curve["values"]))
    return float(curve["grid"][0][best] * engine["pwr_out_max_watts"])


def departing(car: Tree, soc: float, speed_mps: float, t_cl_degc: float | None = None) -> Tree:
    """Return a copy of a car at the start of a trip; of a heated one its engine has `t_cl_degc`."""
    ready = deepcopy(car)
    component(ready, "res")["state"]["soc"] = soc
    ready["state"]["speed_ach_meters_per_second"] = speed_mps
    if t_cl_degc is not None:
        component(ready, "fc_heat")["state"]["temperature_kelvin"] = t_cl_degc + ZERO_DEGC_K
    return ready


def driven(car: Tree, road: Tree) -> Tree:
    """Let FASTSim drive a road with `run_once`; return the car with its last state.

    Where the car cannot follow, FASTSim drives as fast as it can, and goes on.

    Raises
    ------
    QpmpcError
        If FASTSim refuses it.
    """
    allowed = {**fastsim.SimParams.default().to_dict(), "trace_miss_opts": "Allow"}
    simulation = fastsim.SimDrive(
        fastsim.Vehicle.from_dict(car),
        fastsim.Cycle.from_dict(road),
        fastsim.SimParams.from_dict(allowed),
    )
    try:
        simulation.run_once()
    except (RuntimeError, ValueError) as error:  # of many lines
        raise QpmpcError(f"FASTSim: {str(error).partition(chr(10))[0]}") from error
    result: Tree = simulation.to_dict()["veh"]
    return result


def whole_road(cycle: Cycle, t_amb_degc: float | None = None) -> Tree:
    """Return a cycle as FASTSim's: the grade of a second stands at its end."""
    grade = [0.0, *cycle.step_grade.tolist()]
    return _road(cycle.time_s.tolist(), cycle.speed_mps.tolist(), grade, t_amb_degc)


def _road(
    time_s: list[float],
    speed_mps: list[float],
    grade: list[float],
    t_amb_degc: float | None,
    elevation_m: float | None = None,
) -> Tree:
    road: Tree = {
        "init_elev_meters": elevation_m,
        "time_seconds": time_s,
        "speed_meters_per_second": speed_mps,
        "grade": grade,
    }
    if t_amb_degc is not None:
        road["temp_amb_air_kelvin"] = [t_amb_degc + ZERO_DEGC_K] * len(time_s)
    return road


class SecondBySecond:
    """A car of FASTSim under way.

    Parameters
    ----------
    model : which
    soc, speed_mps : at departure
    t_cl_degc, t_amb_degc : of the engine at departure, and of the air; of heated cars only

    Attributes
    ----------
    car : as it will drive the next second
    """

    def __init__(
        self,
        model: Model,
        soc: float,
        speed_mps: float,
        t_cl_degc: float | None = None,
        t_amb_degc: float | None = None,
    ) -> None:
        self.car = departing(shipped_car(model), soc, speed_mps, t_cl_degc)
        self._best_w = best_power_w(parameters(model))
        self._t_amb_degc = t_amb_degc
        self._elevation_m: float | None = None
        self._heated = model.heated
        self._no_rules = NO_RULES | (NO_RULES_OF_HEAT if model.heated else {})

    def drive(self, speed_mps: float, grade: float, command: Command | None) -> Tree:
        """Drive a second; return the car with its new state.

        Parameters
        ----------
        speed_mps : wanted at the end of the second
        grade : of the second
        command : to the engine; None leaves it to FASTSim's own control

        Raises
        ------
        QpmpcError
            If FASTSim refuses the second.
        """
        if command is not None:
            for name, (key, value) in NO_DEMAND.items():
                component(self.car, name)["state"][key] = value
            component(self.car, "pt_cntrl")["RGWDB"] |= {
                **self._no_rules,
                ON_ABOVE: ALWAYS_MPS if command.engine_on else NEVER_MPS,
                POWER_SHARE: float(command.p_eng_w) / self._best_w,
            }
        before_mps = self.car["state"]["speed_ach_meters_per_second"]
        road = _road(
            [0.0, 1.0],
            [before_mps, speed_mps],
            [0.0, grade],
            self._t_amb_degc,
            self._elevation_m,
        )
        now = driven(self.car, road)
        self._carry(now, CARRIED)
        if self._heated:
            self._carry(now, CARRIED_HEAT)
            self._elevation_m = now["state"]["elev_curr_meters"]
        return now

    def _carry(self, now: Tree, carried: dict[str, tuple[str, ...]]) -> None:
        for name, keys in carried.items():
            old, new = component(self.car, name)["state"], component(now, name)["state"]
            old.update((key, new[key]) for key in keys)
