"""FASTSim 3.1 driven second by second, which it does not offer itself.

Its `run_once` drives a whole cycle. Here it drives a cycle of two samples, with a vehicle rebuilt
each time from plain data in which only `CARRIED` has changed: all that FASTSim reads of the second
before. Feeding back the whole state ends in a segmentation fault, and `run` resets SOC. Stepped
like this it repeats its own whole run bit by bit (tests/verification/test_fastsim.py).
"""

from copy import deepcopy
from typing import Any

import fastsim

from qpmpc.cycles import Cycle
from qpmpc.errors import QpmpcError
from qpmpc.vehicle.plant import Command

Tree = dict[str, Any]

CAR = "2016_TOYOTA_Prius_Two.yaml"
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
# Its rule-based control without rules: no power held back for the road ahead, no shortest run, and
# the engine on where the speed is above one that is always, or never, exceeded.
NO_RULES = {
    "speed_soc_disch_buffer_coeff": 0.0,
    "speed_soc_regen_buffer_coeff": 0.0,
    "speed_soc_fc_on_buffer_coeff": 0.0,
    "fc_min_time_on_seconds": 0.0,
    "frac_pwr_demand_fc_forced_on": 1e9,
}
ON_ABOVE = "speed_fc_forced_on_meters_per_second"
ALWAYS_MPS, NEVER_MPS = -1.0, 1e9
# The engine gives the share of its most efficient power that this says, or what the motor cannot.
POWER_SHARE = "frac_of_most_eff_pwr_to_run_fc"
# With these of the second before, no demand calls for the engine.
NO_DEMAND = {"vehicle": ("pwr_tractive_watts", 0.0), "em": ("pwr_mech_fwd_out_max_watts", 1e9)}


def shipped_car() -> Tree:
    """Return FASTSim's 2016 Prius as plain data that can be driven."""
    car = fastsim.Vehicle.from_resource(CAR)
    car.set_save_interval(None)  # no history
    return dict(car.to_dict())


def parameters() -> Tree:
    """Return the same car to be read: its curves are lists, ``{"grid": [x], "values": y}``."""
    return dict(fastsim.Vehicle.from_resource(CAR).to_dict(data_fmt="json"))


def component(car: Tree, name: str) -> Tree:
    """Return a part of a car: engine ``fc``, motor ``em``, battery ``res``, .., or ``vehicle``."""
    part: Tree = car if name == "vehicle" else car["pt_type"]["HEV"][name]
    return part


def best_power_w(car: Tree) -> float:
    """Engine power of the greatest efficiency, the first of several; of `parameters`."""
    engine = component(car, "fc")
    curve = engine["eff_interp_from_pwr_out"]["data"]
    best = curve["values"].index(max(curve["values"]))
    return float(curve["grid"][0][best] * engine["pwr_out_max_watts"])


def departing(car: Tree, soc: float, speed_mps: float) -> Tree:
    """Return a copy of a car at the start of a trip."""
    ready = deepcopy(car)
    component(ready, "res")["state"]["soc"] = soc
    ready["state"]["speed_ach_meters_per_second"] = speed_mps
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


def whole_road(cycle: Cycle) -> Tree:
    """Return a cycle as FASTSim's: the grade of a second stands at its end."""
    return _road(cycle.time_s.tolist(), cycle.speed_mps.tolist(), [0.0, *cycle.step_grade.tolist()])


def _road(time_s: list[float], speed_mps: list[float], grade: list[float]) -> Tree:
    return {
        "init_elev_meters": None,
        "time_seconds": time_s,
        "speed_meters_per_second": speed_mps,
        "grade": grade,
    }


class SecondBySecond:
    """A car of FASTSim under way.

    Parameters
    ----------
    soc, speed_mps : at departure
    """

    def __init__(self, soc: float, speed_mps: float) -> None:
        self._car = departing(shipped_car(), soc, speed_mps)
        self._best_w = best_power_w(parameters())

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
                component(self._car, name)["state"][key] = value
            component(self._car, "pt_cntrl")["RGWDB"] |= {
                **NO_RULES,
                ON_ABOVE: ALWAYS_MPS if command.engine_on else NEVER_MPS,
                POWER_SHARE: float(command.p_eng_w) / self._best_w,
            }
        before_mps = self._car["state"]["speed_ach_meters_per_second"]
        now = driven(self._car, _road([0.0, 1.0], [before_mps, speed_mps], [0.0, grade]))
        for name, keys in CARRIED.items():
            old, new = component(self._car, name)["state"], component(now, name)["state"]
            old.update((key, new[key]) for key in keys)
        return now
