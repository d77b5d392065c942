"""A measured engine, from a CSV file as people have it: a map over speed and torque, or a curve."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpmpc.delimited import Column, DelimitedTable, read_delimited
from qpmpc.errors import InputError
from qpmpc.problems import names_shown, shown_value
from qpmpc.vehicle.engine import RAD_PER_S

Floats = NDArray[np.float64]

MEGABYTES_MAX = 4
POINTS_LEAST = 3
EFFICIENCY_MAX = 0.6  # of any engine; more is a wrong unit

# quantity -> names, and units -> size in SI; the unit may be the last part of the name too
_SPEED = ("speed", "engine_speed", "rpm", "n", "n_eng", "n_mot", "omega")
_TORQUE = ("torque", "engine_torque", "trq", "md", "tau")
_POWER = ("power", "engine_power", "p")
_FUEL = ("fuel", "fuel_rate", "fuel_flow", "fuel_mass_flow", "consumption")
_BSFC = ("bsfc", "be", "specific_consumption", "sfc")
_EFFICIENCY = ("efficiency", "eta", "eff")
_UNITS: dict[str, dict[str, float]] = {
    "speed": {
        "rpm": 1.0,
        "1/min": 1.0,
        "min-1": 1.0,
        "rad/s": 30.0 / np.pi,
        "rad_per_s": 30.0 / np.pi,
    },
    "torque": {"nm": 1.0, "n_m": 1.0, "n*m": 1.0},
    "power": {"w": 1.0, "kw": 1e3},
    "fuel": {"g/s": 1.0, "g_per_s": 1.0, "kg/h": 1.0 / 3.6, "kg_per_h": 1.0 / 3.6, "kg/s": 1e3},
    "bsfc": {"g/kwh": 1.0 / 3.6e6, "g_per_kwh": 1.0 / 3.6e6, "g/kw-h": 1.0 / 3.6e6},
    "efficiency": {"": 1.0, "-": 1.0, "1": 1.0, "%": 1e-2, "percent": 1e-2},
}
# Largest of any engine: more is a wrong unit.
_MOST = {
    "speed": 30e3,
    "torque": 20e3,
    "power": 1e6,
    "fuel": 1e3,
    "bsfc": 1.0 / 36.0,
    "efficiency": 1e3,
}
_NAMES = {
    "speed": _SPEED,
    "torque": _TORQUE,
    "power": _POWER,
    "fuel": _FUEL,
    "bsfc": _BSFC,
    "efficiency": _EFFICIENCY,
}
ALLOWED = (
    "speed_rpm or speed_rad_per_s, torque_nm (a map) or power_kw or power_w (a curve), and one of "
    "fuel_g_per_s, fuel_kg_per_h, bsfc_g_per_kwh, efficiency; units may be in brackets, as in "
    "'Torque [Nm]', or in a row of their own"
)


@dataclass(frozen=True)
class EngineData:
    """Points of a hot engine that runs.

    Attributes
    ----------
    power_w, fuel_g_per_s : shape (points,)
    speed_rpm, torque_nm : likewise, or None for a curve over power
    remarks : what was assumed, and what left out
    """

    power_w: Floats
    fuel_g_per_s: Floats
    speed_rpm: Floats | None
    torque_nm: Floats | None
    remarks: tuple[str, ...]


def read_engine_data(path: Path, lhv_j_per_g: float) -> EngineData:
    """Read a map (speed, torque, fuel) or a curve (power, fuel).

    Fuel is a rate, or a specific consumption, f = b P, or an efficiency, f = P / (eta LHV): the
    first of these that is there. Points without power have neither of the last two, and are left
    out; points at which the engine is dragged are too, and rows with an empty cell.

    Parameters
    ----------
    path : CSV file, see `qpmpc.delimited`
    lhv_j_per_g : lower heating value, where fuel is given as an efficiency

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing, named twice, of an unknown unit, or holds
        what no engine does.
    """
    table = read_delimited(path, MEGABYTES_MAX)
    found, wrong = _quantities(table)
    remarks = [table.assumed] if table.assumed else []
    if table.titles:
        remarks.append(f"{table.titles} line(s) above the header not read")
    speed, torque = found.get("speed"), found.get("torque")
    if speed is not None and torque is not None:
        power = torque * speed * RAD_PER_S
        drags, standing = torque < 0.0, speed <= 0.0
        if "power" in found:
            remarks.append("power is that of torque and speed: its own column is not read")
    elif torque is None and "power" in found:
        power = found["power"]
        drags, standing = power < 0.0, np.zeros(len(power), dtype=bool)
    else:
        titles = names_shown([column.title for column in table.columns])
        raise wrong or InputError(f"{path}: there are {titles}; needed are {ALLOWED}")
    hows = [how for how in ("fuel", "bsfc", "efficiency") if how in found]
    if not hows:
        raise wrong or InputError(f"{path}: needs one column of fuel, has none: {ALLOWED}")
    how, given = hows[0], found[hows[0]]
    if hows[1:]:
        remarks.append(f"{' and '.join(hows[1:])} not read, because {how} is there")
    unknown = np.isnan(power) | np.isnan(given)
    if speed is not None:
        unknown |= np.isnan(speed)
    without = (given == 0.0) | ((power == 0.0) & (how != "fuel"))
    left = np.zeros(len(power), dtype=bool)
    for rows, what in (
        (unknown, "without a value"),
        (standing, "at speed 0 or below"),
        (drags, "at which the engine is dragged"),
        (without, "without fuel" if how == "fuel" else f"without power or {how}"),
    ):
        count = int((rows & ~left).sum())
        left |= rows
        if count:
            remarks.append(f"{count} of {len(power)} points {what} left out")
    keep = ~left
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if how == "fuel":
            fuel = given
        else:
            fuel = given * power if how == "bsfc" else power / (given * lhv_j_per_g)
    if how == "efficiency":
        remarks.append(f"efficiency counted with the base's heating value, {lhv_j_per_g:g} J/g")
    if int(keep.sum()) < POINTS_LEAST:
        raise InputError(f"{path}: {int(keep.sum())} usable points, at least 3 are needed")
    _check(path, table, keep, power, fuel, lhv_j_per_g)
    return EngineData(
        power[keep],
        fuel[keep],
        None if speed is None else speed[keep],
        None if torque is None else torque[keep],
        tuple(remarks),
    )


def _quantities(table: DelimitedTable) -> tuple[dict[str, Floats], InputError | None]:
    """Columns that are known, in SI units but for rpm and g; what is wrong with another."""
    found: dict[str, Floats] = {}
    titles: dict[str, str] = {}
    wrong: InputError | None = None
    for column in table.columns:
        for quantity, names in _NAMES.items():
            try:
                scale = _scale(table.path, column, quantity, names)
            except InputError as error:
                wrong = wrong or error
                continue
            if scale is None:
                continue
            if quantity in found:
                raise InputError(
                    f"{table.path}: {quantity} is in two columns, {shown_value(titles[quantity])} "
                    f"and {shown_value(column.title)}: leave one"
                )
            values = table.numbers(column) * scale
            high = np.flatnonzero(np.abs(values) > _MOST[quantity])
            if len(high):
                raise InputError(
                    f"{table.path}, line {table.lines[high[0]]}: {shown_value(column.title)} is "
                    f"{shown_value(column.cells[high[0]])}, more than any engine has: its unit?"
                )
            found[quantity], titles[quantity] = values, column.title
    return found, wrong


def _scale(path: Path, column: Column, quantity: str, names: tuple[str, ...]) -> float | None:
    """Size of the column's unit if it is of this quantity."""
    units = _UNITS[quantity]
    name, unit = column.name, column.unit
    for suffix in sorted(filter(None, units), key=len, reverse=True):
        if name == suffix:
            name, unit = names[0], unit or suffix
        elif name.endswith(f"_{suffix}"):
            name, unit = name.removesuffix(f"_{suffix}"), unit or suffix
        else:
            continue
        break
    if name not in names:
        return None
    unit = re.sub(r"\s", "", unit)
    if unit not in units:
        known = ", ".join(filter(None, units)) or "none"
        raise InputError(
            f"{path}: {shown_value(column.title)}: unit {shown_value(unit)}, allowed: {known}"
            if unit
            else f"{path}: {shown_value(column.title)} names no unit, allowed: {known}"
        )
    return units[unit]


def _check(
    path: Path,
    table: DelimitedTable,
    keep: NDArray[np.bool_],
    power: Floats,
    fuel: Floats,
    lhv_j_per_g: float,
) -> None:
    """Refuse the first point that no engine has."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        efficiency = power / (fuel * lhv_j_per_g)
    at = np.flatnonzero(
        keep & ((fuel <= 0.0) | (efficiency > EFFICIENCY_MAX) | (fuel > _MOST["fuel"]))
    )
    if not len(at):
        return
    k = at[0]
    said = f"{path}, line {table.lines[k]}: fuel is {fuel[k]:.4g} g/s"
    if fuel[k] <= 0.0:
        raise InputError(f"{said}, must be more than 0")
    raise InputError(
        f"{said} at {power[k]:.4g} W, {efficiency[k]:.0%} efficient: at most {EFFICIENCY_MAX:.0%} "
        "are possible, check the units"
    )
