"""The optimal operating line of a measured engine: at each power the point of least fuel."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.optimize import minimize_scalar
from scipy.spatial import QhullError

from qpmpc.errors import InputError
from qpmpc.vehicle.engine_map import EngineData

Floats = NDArray[np.float64]

POINTS = 201  # of the line; straight between them
SPEEDS = 400  # tried at each power, before the best is refined between its neighbours
SAME_SPEED_RPM = 2.0  # points of a map that a test bench held at one speed
SPEEDS_LEAST = 2


@dataclass(frozen=True)
class OperatingLine:
    """Fuel of the hot engine on its optimal line.

    Attributes
    ----------
    power_w, fuel_g_per_s : shape (points,), power from 0 on
    speed_rpm : at which that is, or None where the data have no speed
    remarks : what was assumed
    """

    power_w: Floats
    fuel_g_per_s: Floats
    speed_rpm: Floats | None
    remarks: tuple[str, ...]


def operating_line(path: Path, data: EngineData) -> OperatingLine:
    """Compute the line of a map, min over N of f(N, P / omega(N)), or take that of a curve.

    A map's fuel rate is linear in triangles of its points (Delaunay), its torque limit the largest
    torque at each speed, linear between speeds; of points that are not at some common speeds the
    edge of the hull. Below the least power of the data the line goes
    on straight to 0, an engine that idles.

    Raises
    ------
    InputError
        If the points do not span a map, or fuel does not increase with power.
    """
    remarks = list(data.remarks)
    if data.torque_nm is None or data.speed_rpm is None:
        power, fuel, speed = _of_curve(path, data)
    else:
        power, fuel, speed = _of_map(path, data.speed_rpm, data.torque_nm, data.fuel_g_per_s)
        if _is_scattered(data.speed_rpm):
            remarks.append("few points share a speed: the torque limit is the hull of all points")
    if (least := int(fuel.argmin())) > 0:
        remarks.append(f"below {power[least] / 1e3:.3g} kW fuel falls with power: left out")
        power, fuel = power[least:], fuel[least:]
        speed = None if speed is None else speed[least:]
    if len(power) < SPEEDS_LEAST:
        raise InputError(f"{path}: least fuel does not increase with power")
    if power[0] > 0.0:
        idle = fuel[0] - power[0] * (fuel[1] - fuel[0]) / (power[1] - power[0])
        if idle <= 0.0:
            raise InputError(
                f"{path}: the line goes on to {idle:.3g} g/s at no power, must be more than 0: add "
                "points of less power, or of the idling engine"
            )
        remarks.append(
            f"below {power[0] / 1e3:.3g} kW, the least of the data, the line goes on straight to "
            f"{idle:.3g} g/s at no power"
        )
        power, fuel = np.append(0.0, power), np.append(idle, fuel)
        speed = None if speed is None else np.append(speed[0], speed)
    falls = np.flatnonzero(np.diff(fuel) <= 0.0)
    if len(falls):
        raise InputError(
            f"{path}: least fuel does not increase with power above {power[falls[0]] / 1e3:.3g} kW"
        )
    return OperatingLine(power, fuel, speed, tuple(remarks))


def _of_curve(path: Path, data: EngineData) -> tuple[Floats, Floats, Floats | None]:
    order = np.argsort(data.power_w, kind="stable")
    power = data.power_w[order]
    twice = np.flatnonzero(np.diff(power) < 1.0)
    if len(twice):
        raise InputError(f"{path}: power {power[twice[0]]:g} W is there twice")
    speed = None if data.speed_rpm is None else data.speed_rpm[order]
    return power, data.fuel_g_per_s[order], speed


def _of_map(
    path: Path, speed_rpm: Floats, torque_nm: Floats, fuel_g_per_s: Floats
) -> tuple[Floats, Floats, Floats]:
    points = np.column_stack([speed_rpm, torque_nm])
    try:
        fuel_at = LinearNDInterpolator(points, fuel_g_per_s, rescale=True)
    except (QhullError, ValueError):
        raise InputError(f"{path}: the points of a map must differ in speed and torque") from None
    speeds, limit_nm = torque_limit(speed_rpm, torque_nm)
    if len(speeds) < SPEEDS_LEAST:
        raise InputError(f"{path}: a map needs points at two speeds or more")
    if _is_scattered(speed_rpm):
        limit_nm = np.full_like(speeds, torque_nm.max())
    tried = np.linspace(speeds[0], speeds[-1], SPEEDS)
    omega = tried * (np.pi / 30.0)
    limit_w = np.interp(tried, speeds, limit_nm) * omega
    least_w = float((speed_rpm * torque_nm).min() * (np.pi / 30.0))
    power = np.linspace(least_w, float(limit_w.max()), POINTS)

    def fuel(n_rpm: Floats, power_w: Floats) -> Floats:
        allowed = np.interp(n_rpm, speeds, limit_nm) * (1.0 + 1e-9)
        torque = power_w / (n_rpm * (np.pi / 30.0))
        found = np.asarray(fuel_at(n_rpm, torque))
        return np.where((torque <= allowed) & np.isfinite(found), found, np.inf)

    rates = fuel(tried[None, :], power[:, None])
    best = rates.argmin(axis=1)
    least = rates[np.arange(POINTS), best]
    at_rpm = tried[best]
    for i in np.flatnonzero(np.isfinite(least)).tolist():
        low, high = tried[max(best[i] - 1, 0)], tried[min(best[i] + 1, SPEEDS - 1)]
        found = minimize_scalar(
            lambda n, p=power[i]: min(float(fuel(np.array(n), p)), 1e9),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 0.05},
        )
        if found.fun < least[i]:
            least[i], at_rpm[i] = found.fun, found.x
    there = np.isfinite(least)
    if there.sum() < SPEEDS_LEAST + 1:
        raise InputError(f"{path}: the points of a map must differ in speed and torque")
    return power[there], least[there], at_rpm[there]


def _is_scattered(speed_rpm: Floats) -> bool:
    return len(torque_limit(speed_rpm, np.zeros_like(speed_rpm))[0]) > len(speed_rpm) / 2


def torque_limit(speed_rpm: Floats, torque_nm: Floats) -> tuple[Floats, Floats]:
    """Largest torque at each speed of a map; shape (speeds,) each, speeds increasing.

    Points within `SAME_SPEED_RPM` of the first of them are of one speed.
    """
    order = np.argsort(speed_rpm, kind="stable")
    speeds: list[float] = []
    limits: list[float] = []
    for n, torque in zip(speed_rpm[order].tolist(), torque_nm[order].tolist(), strict=True):
        if speeds and n - speeds[-1] <= SAME_SPEED_RPM:
            limits[-1] = max(limits[-1], torque)
        else:
            speeds.append(n)
            limits.append(torque)
    return np.array(speeds), np.array(limits)
