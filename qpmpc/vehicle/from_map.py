"""A vehicle file with the engine of a map: the rest is that of a base."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpmpc.settings import validated
from qpmpc.shown import shown
from qpmpc.vehicle.engine_map import EngineData, read_engine_data
from qpmpc.vehicle.engine_parameters import LINE, LINE_TOO, MAP
from qpmpc.vehicle.load import load_vehicle
from qpmpc.vehicle.operating_line import OperatingLine, operating_line
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.toml_text import Comment, comments_of, vehicle_file_text, vehicle_toml

KEPT = "start cost, shortest runs, time to full power, cold multiplier and heat"


@dataclass(frozen=True)
class MappedVehicle:
    """A vehicle made from an engine's data.

    Attributes
    ----------
    vehicle, toml : parameters, and their file
    data, line : the points read, and the line made of them
    remarks : what was assumed, left out and kept, a line each
    """

    vehicle: Vehicle
    toml: str
    data: EngineData
    line: OperatingLine
    remarks: tuple[str, ...]

    @property
    def best_efficiency(self) -> float:
        """Greatest efficiency on the line."""
        return float(self._efficiency().max())

    @property
    def best_power_w(self) -> float:
        """Power of the greatest efficiency."""
        return float(self.line.power_w[int(self._efficiency().argmax())])

    def _efficiency(self) -> NDArray[np.float64]:
        line = self.line
        return line.power_w / (line.fuel_g_per_s * self.vehicle.engine.lhv_j_per_g)

    def summary(self) -> dict[str, object]:
        """Return the figures for JSON."""
        return {
            "vehicle": self.vehicle.name,
            "points": len(self.data.power_w),
            "power_max_w": self.vehicle.engine.power_max_w,
            "idle_fuel_g_per_s": float(self.line.fuel_g_per_s[0]),
            "best_efficiency": self.best_efficiency,
            "best_efficiency_power_w": self.best_power_w,
            "remarks": list(self.remarks),
        }


def vehicle_from_map(path: Path, base: str, name: str) -> MappedVehicle:
    """Put the engine of a map or a curve into a base vehicle.

    The rated power is the greatest of the data, the rise of power per second keeps the base's time
    to full power.

    Parameters
    ----------
    path : of the engine's CSV file, see `read_engine_data`
    base : name or file of the vehicle that gives all else
    name : of the new vehicle

    Raises
    ------
    InputError
        If a file cannot be read, or if what they make is not an engine.
    """
    under = load_vehicle(base)
    validated(Vehicle, under.model_dump() | {"name": name}, "--name, or the name of --out")
    data = read_engine_data(path, under.engine.lhv_j_per_g)
    line = operating_line(path, data)
    power_max_w = float(math.floor(line.power_w[-1]))
    old = under.engine
    ramp_w_per_s = round(min(old.ramp_w_per_s * power_max_w / old.power_max_w, 1e6), 1)
    changed: dict[str, object] = dict.fromkeys(MAP)
    changed |= {
        "power_max_w": power_max_w,
        "power_min_w": min(old.power_min_w, 0.5 * power_max_w, ramp_w_per_s),
        "ramp_w_per_s": ramp_w_per_s,
        LINE[0]: _rounded(line.power_w, 1),
        LINE[1]: _rounded(line.fuel_g_per_s, 6),
        LINE_TOO[0]: None if line.speed_rpm is None else _rounded(line.speed_rpm, 1),
    }
    described = f"{under.name} with the engine of {path.name}"[:1000]
    content = under.model_dump() | {"name": name, "description": described}
    content["engine"] |= changed
    vehicle = validated(Vehicle, content, f"{path}, as the engine of {base}")
    remarks = [
        *line.remarks,
        f"of {under.name}: all but the engine's fuel and power; of its engine {KEPT}",
    ]
    if vehicle.engine.power_min_w != old.power_min_w:
        remarks.append(
            f"power_min_w is {vehicle.engine.power_min_w:g}: the base's is too much for this engine"
        )
    return MappedVehicle(
        vehicle,
        _toml(vehicle, base, path, line, data),
        data,
        line,
        tuple(remarks),
    )


def _rounded(values: NDArray[np.float64], digits: int) -> tuple[float, ...]:
    return tuple(np.round(values, digits).tolist())


def _toml(vehicle: Vehicle, base: str, path: Path, line: OperatingLine, data: EngineData) -> str:
    comments = comments_of(vehicle_file_text(base))
    for key in ("power_max_w", "ramp_w_per_s"):
        comments.pop(f"engine.{key}", None)
    comments[""] = Comment((f"# The vehicle {shown(base)} with the engine of {shown(path.name)}.",))
    kind = "a curve" if data.torque_nm is None else "a map over speed and torque"
    said = [f"# Optimal line, computed from {len(data.power_w)} points of {kind}."]
    said += [f"# {shown(remark)}" for remark in line.remarks]
    comments["engine.line_power_w"] = Comment(tuple(said))
    return vehicle_toml(vehicle, comments)
