"""The optimal operating line of a measured engine: at each power the point of least fuel."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.optimize import minimize_scalar
from scipy.spatial import QhullError

from qpmpc.errors import InputError
from qpmpc.vehicle.engine import RAD_PER_S
from qpmpc.vehicle.engine_map import EngineData

Floats = NDArray[np.float64]

POINTS = 201  # of the line; straight between them
SPEEDS = 400  # tried at each power, before the best is refined between its neighbours
SPEEDS_LEAST = 2
# Points of a map whose speeds are less than this share of all speeds apart were held at one speed.
SAME_SPEED = 0.005
PER_SPEED_LEAST = 2  # points at a speed in the mean, else they are scattered
WIDTH_MAX = 0.2  # of the points at a speed, in spacings between speeds: likewise
IDLE_W = 1.0  # less power than that is none


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

    Of a map's fuel rate, what is not c P is linear in triangles of its points (Delaunay), with c of
    a least-squares fit of c P, N, N^2 and a constant. Its limits are the largest and the least
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
        power, fuel, speed = _of_map(path, data, remarks)
    power = np.where(power < IDLE_W, 0.0, power)
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
    fuel = data.fuel_g_per_s[order]
    if len(power) > POINTS:
        fewer = np.linspace(power[0], power[-1], POINTS)
        speed = None if speed is None else np.interp(fewer, power, speed)
        power, fuel = fewer, np.interp(fewer, power, fuel)
    return power, fuel, speed


def _of_map(path: Path, data: EngineData, remarks: list[str]) -> tuple[Floats, Floats, Floats]:
    speed_rpm, torque_nm, fuel_g_per_s = _once(data, remarks)
    try:
        rate = _Rate(speed_rpm, torque_nm, fuel_g_per_s)
    except (QhullError, ValueError):
        raise InputError(f"{path}: the points of a map must differ in speed and torque") from None
    speeds, least_nm, most_nm = torque_range(speed_rpm, torque_nm)
    if len(speeds) < SPEEDS_LEAST:
        raise InputError(f"{path}: a map needs points at two speeds or more")
    if _is_scattered(speed_rpm):
        remarks.append("few points share a speed: the torque limit is the hull of all points")
        least_nm, most_nm = (np.full_like(speeds, f(torque_nm)) for f in (np.min, np.max))
    tried = np.linspace(speed_rpm.min(), speed_rpm.max(), SPEEDS)
    powers_w = speed_rpm * torque_nm * RAD_PER_S
    power = np.linspace(float(powers_w.min()), float(powers_w.max()), POINTS)

    def fuel(n_rpm: Floats, power_w: Floats) -> Floats:
        """Fuel rate where the engine can run, else infinite; shape (m,) each."""
        torque = power_w / (n_rpm * RAD_PER_S)
        can = torque <= np.interp(n_rpm, speeds, most_nm) * (1.0 + 1e-9)
        can &= torque >= np.interp(n_rpm, speeds, least_nm) * (1.0 - 1e-9)
        found = np.full(n_rpm.shape, np.inf)
        found[can] = rate(n_rpm[can], torque[can])
        return np.where(np.isfinite(found), found, np.inf)

    least, at_rpm = np.full(POINTS, np.inf), np.full(POINTS, np.nan)
    for i in range(POINTS):
        at_power = fuel(tried, np.full(SPEEDS, power[i]))
        best = int(at_power.argmin())
        least[i], at_rpm[i] = at_power[best], tried[best]
        if not np.isfinite(least[i]):
            continue
        found = minimize_scalar(
            lambda n, p=power[i]: min(float(fuel(np.array([n]), np.array([p]))[0]), 1e9),
            bounds=(tried[max(best - 1, 0)], tried[min(best + 1, SPEEDS - 1)]),
            method="bounded",
            options={"xatol": 0.05},
        )
        if found.fun < least[i]:
            least[i], at_rpm[i] = found.fun, found.x
    there = np.isfinite(least)
    if there.sum() < SPEEDS_LEAST + 1:
        raise InputError(f"{path}: the points of a map must differ in speed and torque")
    return power[there], least[there], at_rpm[there]


def _once(data: EngineData, remarks: list[str]) -> tuple[Floats, Floats, Floats]:
    """Points of a map, each once: of those measured again the mean."""
    points = np.column_stack([data.speed_rpm, data.torque_nm])  # type: ignore[list-item]
    once, place = np.unique(points, axis=0, return_inverse=True)
    again = len(points) - len(once)
    if again:
        remarks.append(f"{again} points measured again: the mean counts")
    fuel = np.bincount(place.ravel(), data.fuel_g_per_s) / np.bincount(place.ravel())
    return once[:, 0], once[:, 1], fuel


class _Rate:
    """Fuel rate of a map, linear in triangles but for its part in proportion to power."""

    def __init__(self, speed_rpm: Floats, torque_nm: Floats, fuel_g_per_s: Floats) -> None:
        power_w = speed_rpm * torque_nm * RAD_PER_S
        terms = np.column_stack([power_w, speed_rpm, speed_rpm**2, np.ones_like(power_w)])
        scale = np.abs(terms).max(axis=0)
        self._per_w = float(
            np.linalg.lstsq(terms / scale, fuel_g_per_s, rcond=None)[0][0] / scale[0]
        )
        self._rest = LinearNDInterpolator(
            np.column_stack([speed_rpm, torque_nm]),
            fuel_g_per_s - self._per_w * power_w,
            rescale=True,
        )

    def __call__(self, speed_rpm: Floats, torque_nm: Floats) -> Floats:
        power_w = speed_rpm * torque_nm * RAD_PER_S
        return np.asarray(self._rest(speed_rpm, torque_nm) + self._per_w * power_w)


def torque_range(speed_rpm: Floats, torque_nm: Floats) -> tuple[Floats, Floats, Floats]:
    """Speeds of a map, and the least and the largest torque at each; shape (speeds,).

    A speed is the mean of points whose speeds follow one another within `SAME_SPEED` of all.
    """
    groups = _of_one_speed(speed_rpm)
    return (
        np.array([speed_rpm[group].mean() for group in groups]),
        np.array([torque_nm[group].min() for group in groups]),
        np.array([torque_nm[group].max() for group in groups]),
    )


def _of_one_speed(speed_rpm: Floats) -> list[NDArray[np.intp]]:
    order = np.argsort(speed_rpm, kind="stable")
    speed = speed_rpm[order]
    apart = np.diff(speed) > SAME_SPEED * (speed[-1] - speed[0])
    return np.split(order, np.flatnonzero(apart) + 1)


def _is_scattered(speed_rpm: Floats) -> bool:
    """Whether points have speeds of their own: few are of one speed, or those are far apart."""
    groups = _of_one_speed(speed_rpm)
    if len(groups) * PER_SPEED_LEAST > len(speed_rpm):
        return True
    spacing = np.median(np.diff([speed_rpm[group].mean() for group in groups]))
    width = np.median([np.ptp(speed_rpm[group]) for group in groups if len(group) > 1])
    return bool(width > WIDTH_MAX * spacing)
