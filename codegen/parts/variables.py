"""The variables of a part: what goes in and out each second, with units and limits."""

from dataclasses import dataclass
from typing import Literal

from qpmpc.codegen.calibration import Calibration, Entry
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.parameters import Vehicle

Kind = Literal["real", "integer", "boolean"]
Role = Literal["independent", "parameter", "tunable", "input", "output"]

LAST_FLAG = 64  # of mpc_out.flags
LAST_RUNG = 2


@dataclass(frozen=True)
class Variable:
    """One variable; its value reference is its place in the list.

    Attributes
    ----------
    name : in Python, C and the tool that simulates
    role : what FMI calls causality; `tunable` is a parameter that may change under way
    description : in one line
    kind : of its values
    unit : one of `qpmpc.codegen.parts.units.UNITS`; none for integers and booleans
    start : before the first second
    low, high : least and greatest value that has a meaning, if there are such
    display : unit in which a tool may show it
    follows : whether it follows from inputs at once, without a step between
    at_start : parameters that an output has its first value from; None if that is `start`
    continuous : whether it is sampled from something that changes steadily; others are held
    """

    name: str
    role: Role
    description: str
    kind: Kind = "real"
    unit: str | None = None
    start: float = 0.0
    low: float | None = None
    high: float | None = None
    display: str | None = None
    follows: bool = False
    at_start: tuple[str, ...] | None = None
    continuous: bool = False


TIME = Variable("time", "independent", "Time", unit="s", continuous=True)


def controller_variables(
    vehicle: Vehicle, calibration: Calibration, learning: bool, certificate: bool
) -> list[Variable]:
    """Return the variables of a controller.

    Parameters
    ----------
    vehicle : that it is made for
    calibration : its numbers that are tuned
    learning : whether it reads the fuel injected
    certificate : whether its plan comes with a proof of how good it is
    """
    trip = vehicle.trip
    can = Capability.of(vehicle, optimal_line(vehicle.engine))
    fuel = Variable(
        "fuel_g", "input", "Measured fuel injected in the last second", unit="g", low=0.0
    )
    quality = (
        Variable(
            "certificate_g",
            "output",
            "Fuel by which the plan of this second may at most be improved, proven; 0 without a "
            "new plan",
            unit="g",
            follows=True,
        )
        if certificate
        else Variable(
            "relaxation_gap",
            "output",
            "Relative slack of the plan's relaxed curves: 0 where the plan is exact; 0 too without "
            "a new plan",
            unit="1",
            follows=True,
        )
    )
    return [
        TIME,
        _soc("input", "Measured state of charge of the battery", trip.soc_init),
        _coolant("input", "Measured coolant temperature", vehicle, can),
        *_road("input", can),
        _engine_on("input"),
        *([fuel] if learning else []),
        *_command("output", vehicle),
        Variable(
            "on_share",
            "output",
            "Share of the second for which the plan has the engine on, to the tolerance of its "
            "solver; 0 without a new plan",
            unit="1",
            follows=True,
        ),
        quality,
        Variable(
            "rung",
            "output",
            "Where the command comes from: 0 plan of this second, 1 earlier plan, 2 rules",
            kind="integer",
            low=0,
            high=LAST_RUNG,
            follows=True,
        ),
        Variable(
            "flags",
            "output",
            "What was wrong in this second, a sum of: 1 measurement, 2 preview, 4 solver, 8 "
            "warming up, 16 clock, 32 memory, 64 calibration",
            kind="integer",
            low=0,
            high=2 * LAST_FLAG - 1,
            follows=True,
        ),
        *map(_tunable, calibration.entries),
    ]


def _tunable(entry: Entry) -> Variable:
    unit = "1" if entry.unit == "SOC" else entry.unit
    return Variable(
        entry.name,
        "tunable",
        f"Calibration: {entry.what}",
        unit=unit,
        start=entry.default,
        low=entry.least,
        high=entry.most,
        display={"SOC": "%", "W": "kW", "W/s": "kW/s"}.get(entry.unit),
    )


def plant_variables(vehicle: Vehicle, with_trip: bool) -> list[Variable]:
    """Return the variables of the plant; with a trip, demand and speed are outputs."""
    trip = vehicle.trip
    can = Capability.of(vehicle, optimal_line(vehicle.engine))
    return [
        TIME,
        Variable(
            "soc_init",
            "parameter",
            "State of charge at departure",
            unit="1",
            start=trip.soc_init,
            low=0.0,
            high=1.0,
            display="%",
        ),
        Variable(
            "t_cl_init_degc",
            "parameter",
            "Coolant temperature at departure",
            unit="degC",
            start=trip.t_cl_init_degc,
            low=can.coldest_degc,
            high=can.hottest_degc,
        ),
        *_command("input", vehicle),
        *_road("output" if with_trip else "input", can),
        _soc("output", "State of charge of the battery", trip.soc_init, ("soc_init",)),
        _coolant("output", "Coolant temperature", vehicle, can, ("t_cl_init_degc",)),
        _engine_on("output"),
        Variable("fuel_g", "output", "Fuel injected in the last second", unit="g", low=0.0),
        Variable("fuel_total_g", "output", "Fuel injected since departure", unit="g", low=0.0),
        _power("p_eng_w", "Power of the engine in the last second", 0.0, vehicle),
        _power("p_bat_w", "Power of the battery at its terminals, negative while it is charged"),
        _power("p_friction_w", "Power of the friction brakes, as the battery would see it", 0.0),
        _power("p_missing_w", "Demand that neither engine nor battery could meet"),
        _power("power_excess_w", "Excess of the command over engine or battery limits", 0.0),
    ]


def _power(
    name: str, description: str, low: float | None = None, vehicle: Vehicle | None = None
) -> Variable:
    high = None if vehicle is None else vehicle.engine.power_max_w
    return Variable(name, "output", description, unit="W", low=low, high=high, display="kW")


def _soc(
    role: Role, description: str, start: float, at_start: tuple[str, ...] | None = None
) -> Variable:
    return Variable(
        "soc",
        role,
        description,
        unit="1",
        start=start,
        low=0.0,
        high=1.0,
        display="%",
        at_start=at_start,
        continuous=True,
    )


def _coolant(
    role: Role,
    description: str,
    vehicle: Vehicle,
    can: Capability,
    at_start: tuple[str, ...] | None = None,
) -> Variable:
    return Variable(
        "t_cl_degc",
        role,
        description,
        unit="degC",
        start=vehicle.trip.t_cl_init_degc,
        low=can.coldest_degc,
        high=can.hottest_degc,
        at_start=at_start,
        continuous=True,
    )


def _road(role: Role, can: Capability) -> list[Variable]:
    from_trip = () if role == "output" else None
    return [
        Variable(
            "demand_w",
            role,
            "Power demand of the coming second at battery and engine, negative when braking",
            unit="W",
            low=can.demand_min_w,
            high=can.demand_max_w,
            display="kW",
            at_start=from_trip,
        ),
        Variable(
            "speed_mps",
            role,
            "Mean speed of the coming second",
            unit="m/s",
            low=0.0,
            high=can.speed_max_mps,
            display="km/h",
            at_start=from_trip,
        ),
    ]


def _engine_on(role: Role) -> Variable:
    return Variable("engine_on", role, "Whether the engine ran in the last second", kind="boolean")


def _command(role: Role, vehicle: Vehicle) -> list[Variable]:
    return [
        Variable(
            "engine_on_command",
            role,
            "Command of the second: whether the engine runs",
            kind="boolean",
            follows=role == "output",
        ),
        Variable(
            "p_eng_command_w",
            role,
            "Command of the second: power of the engine, 0 with the engine off",
            unit="W",
            low=0.0,
            high=vehicle.engine.power_max_w,
            display="kW",
            follows=role == "output",
        ),
    ]
