"""What a description names: measurements of state, inputs and outputs, and the units shown."""

from dataclasses import dataclass

from qpmpc.controllers.monitor import Flag

Limit = float | str  # a number, or the name of one in the image's mpc_model
RUNGS = {0: "optimised", 1: "shifted plan", 2: "rules"}
YES_NO = {0: "no", 1: "yes"}
LONG_TIME = 1e9  # of a count


@dataclass(frozen=True)
class Unit:
    """How a unit of the C code is shown: `shown` = `factor` times the number there."""

    shown: str
    factor: float = 1.0
    digits: int = 3


UNITS = {
    "SOC": Unit("%", 100.0, 2),
    "W": Unit("kW", 1e-3),
    "W/s": Unit("kW/s", 1e-3),
    "degC": Unit("degC", 1.0, 2),
    "m/s": Unit("km/h", 3.6, 2),
    "s": Unit("s", 1.0, 0),
    "g": Unit("g", 1.0, 6),
    "g/s": Unit("g/s", 1.0, 6),
    "g/K": Unit("g/K"),
    "1": Unit("-"),
}


@dataclass(frozen=True)
class Measured:
    """A number to be read: where from the structure on, unit or table, text, limits in the unit."""

    path: str
    unit: str
    what: str
    least: Limit
    most: Limit
    table: dict[int, str] | None = None
    mask: int = 0


def _yes_no(path: str, what: str, mask: int = 0) -> Measured:
    return Measured(path, "1", what, 0.0, 1.0, YES_NO, mask)


SOC, DEGC = (0.0, 1.0), ("can_coldest_degc", "can_hottest_degc")
DEMAND, POWER = ("can_demand_min_w", "can_demand_max_w"), (0.0, "engine_max_w")
SPEED, COUNT = (0.0, "can_speed_max_mps"), (0.0, LONG_TIME)

OF_STATE = [
    Measured("watch.good.soc", "SOC", "SOC in use: measured, or predicted", *SOC),
    Measured("watch.good.t_cl_degc", "degC", "coolant in use: measured, or predicted", *DEGC),
    Measured("watch.good.demand_w", "W", "demand in use", *DEMAND),
    Measured("watch.good.speed_mps", "m/s", "speed in use", *SPEED),
    Measured("watch.good.engine_for_s", "s", "since the engine was started or stopped", *COUNT),
    Measured("watch.command_w", "W", "last command: engine power", *POWER),
    _yes_no("watch.command_on", "last command: engine on"),
    Measured("highest_floor_degc", "degC", "highest coolant that the plan asks for", *DEGC),
    Measured(
        "old_least_w",
        "W",
        "least power that ramp, battery or a run that goes on asks for",
        *POWER,
    ),
    Measured("old_age", "s", "age of the plan in use", *COUNT),
    Measured("road_age", "s", "age of the preview in use", *COUNT),
    Measured("failures", "1", "failures of the solver in a row", *COUNT),
    Measured(
        "search.share", "1", "share of the way to its aim that the search tries next", 0.0, 16
    ),
]
OF_INPUT = [
    Measured("soc", "SOC", "measured SOC", *SOC),
    Measured("t_cl_degc", "degC", "measured coolant", *DEGC),
    Measured("demand_w", "W", "demand of the coming second", *DEMAND),
    Measured("speed_mps", "m/s", "speed of the coming second", *SPEED),
    Measured("second", "s", "clock", -LONG_TIME, LONG_TIME),
    _yes_no("engine_on", "measured: the engine ran"),
    Measured("fuel_g", "g", "measured fuel of the last second", 0.0, "learned_most_g"),
]
OF_OUTPUT = [
    Measured("p_eng_w", "W", "command: engine power", *POWER),
    _yes_no("engine_on", "command: engine on"),
    Measured("on_share", "1", "planned on-share of the coming second", 0.0, 1.0),
    Measured("certificate_g", "g", "by how much the plan may be improved at most", -1e6, 1e6),
    Measured("relaxation_gap", "1", "slack of the relaxed curves", 0.0, 1e6),
    Measured("rung", "1", "rung of the ladder", 0.0, 2.0, RUNGS),
    Measured("iterations", "1", "iterations of the solver used in the second", *COUNT),
    Measured("flags", "1", "what was wrong in the second, all bits", 0.0, 127.0),
    *(_yes_no("flags", f"{flag.names()[0]} in the second", flag.value) for flag in Flag),
]
WRONG_ENTRY = "wrong_entry"
