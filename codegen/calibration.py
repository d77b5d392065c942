"""The numbers of generated C that are tuned on the car: a page in RAM, its bounds and defaults.

They are members of `mpc_calibration` in C. Only numbers that nothing else is made of when the code
is generated are among them: with a changed value the controller decides as one generated anew.
See docs/calibration.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from qpmpc.controllers import realise
from qpmpc.vehicle.parameters import Vehicle

LEAST_ROOM_SOC = 0.05  # between the limits of SOC, and as much as a second may take
LEAST_ROOM_K = 1.0  # between those of the planned coolant temperature
COLDEST_DEGC, HOTTEST_DEGC = -40.0, 120.0
SOC_STEP = 0.01  # of the search for the SOC at which the battery still gives its power
SCALE = (0.5, 2.0)  # of the fuel map

Bounds = tuple[float, float]


@dataclass(frozen=True)
class Entry:
    """One number, its default and its bounds in `unit`; of SOC in shares of a full battery."""

    name: str
    unit: str
    what: str
    default: float
    least: float
    most: float


@dataclass(frozen=True)
class Order:
    """The entry `low` has to stay below `high` by `gap` at least."""

    low: str
    high: str
    gap: float


@dataclass(frozen=True)
class Calibration:
    """All entries in the order of the page, and what has to hold between them."""

    entries: tuple[Entry, ...]
    orders: tuple[Order, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the entries."""
        return tuple(entry.name for entry in self.entries)

    def without(self, scalars: Mapping[str, float]) -> dict[str, float]:
        """Return the numbers that are not in the page."""
        return {name: value for name, value in scalars.items() if name not in self.names}

    def place(self, name: str) -> int:
        """Return the place of an entry in the page."""
        return self.names.index(name)


# Name, unit and what it does, in the order of the page: first those of the safety layer, which
# mpc_calibration.c checks in the page in use too. Units are those of the C code.
OF_SAFETY = 7
OF_ALL = """
soc_min|SOC|lower limit of SOC, of plan and safety layer
soc_max|SOC|upper limit of SOC, of plan and safety layer
t_cl_min_degc|degC|lower limit of the coolant, of the safety layer
t_cl_max_degc|degC|upper limit of the coolant, of the safety layer
ramp_w_per_s|W/s|most that the engine's power rises in a second
fuel_scale|1|factor on the fuel map
start_fuel_g|g|fuel that a start of the engine takes
terminal_soc_low|SOC|lower end of the SOC planned for the arrival
terminal_soc_high|SOC|upper end of the SOC planned for the arrival
soc_reserve|SOC|SOC kept above the lower limit at the end of a block in which the thermostat opens
t_min_degc|degC|lower limit of the coolant in the plan: that of the safety layer and a reserve
t_max_degc|degC|upper limit of the coolant in the plan
slack_g_per_k|g/K|price of exceeding a coolant limit of the plan, fuel per stage
on_threshold|1|share of a second from which on the planned engine runs
rule_k_soc_w|W|last rung: power asked for per whole charge below the reference
rule_soc_ref|SOC|last rung: reference of SOC
rule_on_w|W|last rung: the engine starts above this power
rule_off_w|W|last rung: and stops below this one
rule_power_min_w|W|last rung: least power when it runs for power
rule_heat_power_w|W|last rung: power when it runs for heat alone
rule_heat_on_degc|degC|last rung: the engine starts for heat below this coolant temperature
rule_heat_off_degc|degC|last rung: until above this one
rule_soc_forced|SOC|last rung: the engine is forced on below this SOC
rise_share|1|share of the rises of demand in a block that are taken for starts
"""
OF_SEARCH = """
search_least_rise_g|g|rise of the dual from which on a round counts
search_first_share|1|share of the way to its aim that the first round tries
search_switch_g_per_s|g/s|cost over which on and off are smoothed, at a usual price of SOC and power
search_long_switch_g_per_s|g/s|the same, longer stages
"""
DESCRIBED = {  # unit and text of every entry, by name
    name: (unit, what)
    for name, unit, what in (line.split("|") for line in (OF_ALL + OF_SEARCH).split("\n") if line)
}


def calibration_of(
    vehicle: Vehicle,
    scalars: Mapping[str, float],
    has_start: bool,
    learning: bool = False,
    search: Mapping[str, tuple[float, Bounds]] | None = None,
    band_soc: float = 0.0,
) -> Calibration:
    """Return the page of a controller.

    Parameters
    ----------
    vehicle : parameters
    scalars : all numbers of the controller, by their names in C
    has_start : whether a start of the engine costs anything; without, its numbers are fixed
    learning : whether the fuel map is learned; then its factor is fixed
    search : default and bounds of the numbers of the costate search, if there is one
    band_soc : least width of the band of SOC at arrival
    """
    given = {"fuel_scale": 1.0, "on_threshold": realise.ON_THRESHOLD, **scalars}
    given |= {name: default for name, (default, _) in (search or {}).items()}
    bounds = _bounds(vehicle, scalars, has_start, learning)
    bounds |= {name: limits for name, (_, limits) in (search or {}).items()}
    names = [name for name in DESCRIBED if search or not name.startswith("search_")]
    entries = []
    for name in names:
        (unit, what), default = DESCRIBED[name], float(given[name])
        least, most = bounds[name]
        entries.append(Entry(name, unit, what, default, min(least, default), max(most, default)))
    page = {entry.name: entry.default for entry in entries}
    room_soc = max(LEAST_ROOM_SOC, _second_soc(vehicle))
    return Calibration(tuple(entries), tuple(_orders(page, room_soc, band_soc)))


def _bounds(
    vehicle: Vehicle, scalars: Mapping[str, float], has_start: bool, learning: bool
) -> dict[str, Bounds]:
    soc, most_w = _soc_with_power(vehicle), scalars["engine_max_w"]
    coolant, power = (COLDEST_DEGC, HOTTEST_DEGC), (0.0, most_w)
    opens = vehicle.thermal.thermostat_open_degc

    def fixed(name: str) -> Bounds:
        return scalars[name], scalars[name]

    return {
        **dict.fromkeys(("soc_min", "soc_max", "terminal_soc_low", "terminal_soc_high"), soc),
        **dict.fromkeys(("rule_soc_ref", "rule_soc_forced"), soc),
        "soc_reserve": (0.0, vehicle.battery.soc_max - vehicle.battery.soc_min),
        "t_cl_min_degc": (COLDEST_DEGC, opens),
        "t_cl_max_degc": (opens, HOTTEST_DEGC),
        **dict.fromkeys(("t_min_degc", "t_max_degc"), coolant),
        **dict.fromkeys(("rule_heat_on_degc", "rule_heat_off_degc"), coolant),
        "slack_g_per_k": (0.1, 1e3),
        "fuel_scale": (1.0, 1.0) if learning else SCALE,
        "on_threshold": (0.1, 0.9),
        "ramp_w_per_s": (1e3, scalars["ramp_w_per_s"]),
        "rule_k_soc_w": (0.0, 1e6),
        **dict.fromkeys(("rule_on_w", "rule_off_w", "rule_power_min_w"), power),
        "rule_heat_power_w": power,
        "start_fuel_g": (0.0, 5.0) if has_start else fixed("start_fuel_g"),
        "rise_share": (0.0, 1.0) if has_start else fixed("rise_share"),
    }


def _soc_with_power(vehicle: Vehicle) -> Bounds:
    """SOC, around the limits of the car, at which the battery can give its rated power."""
    battery = vehicle.battery
    grid = np.linspace(0.0, 1.0, round(1.0 / SOC_STEP) + 1)
    voltage = np.interp(grid, battery.soc_grid, battery.open_circuit_v)
    resistance = np.interp(grid, battery.soc_grid, battery.resistance_discharge_ohm)
    weak = grid[voltage**2 / (4.0 * resistance) <= battery.power_discharge_max_w]
    below, above = weak[weak < battery.soc_min], weak[weak > battery.soc_max]
    least = float(below.max()) + SOC_STEP if len(below) else 0.0
    most = float(above.min()) - SOC_STEP if len(above) else 1.0
    return round(min(least, battery.soc_min), 6), round(max(most, battery.soc_max), 6)


def _second_soc(vehicle: Vehicle) -> float:
    """SOC that a second at the largest power takes, at most."""
    battery = vehicle.battery
    most_w = max(battery.power_discharge_max_w, battery.power_charge_max_w)
    return most_w / (3600.0 * battery.capacity_ah * min(battery.open_circuit_v))


def _orders(page: Mapping[str, float], room_soc: float, band_soc: float) -> list[Order]:
    """What has to hold between entries; where the car's own numbers are closer, as close.

    Half of that: the defaults keep it in any precision. Where they do not keep the order at all,
    twice of that.
    """
    wanted = [
        Order("soc_min", "soc_max", room_soc),
        Order("soc_min", "terminal_soc_low", 0.0),
        Order("terminal_soc_low", "terminal_soc_high", band_soc),
        Order("terminal_soc_high", "soc_max", 0.0),
        Order("t_cl_min_degc", "t_min_degc", 0.0),
        Order("t_min_degc", "t_max_degc", LEAST_ROOM_K),
        Order("t_max_degc", "t_cl_max_degc", 0.0),
        Order("rule_off_w", "rule_on_w", 0.0),
        Order("rule_heat_on_degc", "rule_heat_off_degc", 0.0),
    ]
    found = []
    for order in wanted:
        room = page[order.high] - page[order.low]
        kept = 0.5 * room if room >= 0.0 else 2.0 * room
        found.append(Order(order.low, order.high, min(order.gap, kept)))
    return found
