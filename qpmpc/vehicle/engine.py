"""Engine: fuel map, optimal operating line, cold multiplier."""

from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.errors import InputError
from qpmpc.vehicle.engine_parameters import ColdEngine, Engine
from qpmpc.vehicle.table import Table

Floats = NDArray[np.float64]

LINE_STEP_W = 50.0
RAD_PER_S = np.pi / 30.0  # of a revolution per minute
RATED_SHARE = 1e-3  # by which the torque limit may fall short of the rated power
ROUNDING_W = 1e-6
LINES_KEPT = 32  # some 80 KiB each


def fuel_power_w(engine: Engine, speed_rpm: ArrayLike, power_w: ArrayLike) -> NDArray[np.float64]:
    """Fuel power of the hot engine at any speed and power.

    P_fuel = 1e3 K(N) V_L N / 60 + P_eng / eta_ind, the fuel map of paper eq. (5).

    Parameters
    ----------
    speed_rpm, power_w : broadcastable arrays

    Returns
    -------
    fuel power in W, same shape; the torque limit is not checked here
    """
    speed = np.asarray(speed_rpm, dtype=float)
    friction = np.interp(
        speed, _of_map(engine.friction_speed_rpm), _of_map(engine.friction_kj_per_rev_l)
    )
    pumping_w = 1e3 * friction * _of_map(engine.displacement_l) * speed / 60.0
    return np.asarray(pumping_w + np.asarray(power_w) / _of_map(engine.indicated_efficiency))


Value = TypeVar("Value")


def _of_map(value: Value | None) -> Value:
    if value is None:
        raise InputError("this engine is given by its optimal line: it has no map over speed")
    return value


class OptimalLine:
    """Optimal operating line: at each power the speed of least fuel within the torque limit.

    Of an engine that is given by its line, that line; between its points fuel is linear.

    Attributes
    ----------
    power_w, speed_rpm, torque_nm, fuel_g_per_s : arrays along the line, shape (m,); speed and
        torque are NaN where an engine's line comes without speed
    fuel : `Table` power_w -> fuel_g_per_s of the hot engine, engine on
    power_max_w : rated power
    """

    def __init__(self, engine: Engine) -> None:
        count = int(np.ceil(engine.power_max_w / LINE_STEP_W)) + 1
        self.power_w = np.linspace(0.0, engine.power_max_w, count)
        if engine.line_power_w is None:
            self.speed_rpm, self.fuel_g_per_s = self._from_map(engine)
        else:
            self.speed_rpm, self.fuel_g_per_s = self._given(engine)
        self.torque_nm = self.power_w / (self.speed_rpm * RAD_PER_S)
        self.fuel = Table(self.power_w, self.fuel_g_per_s)
        self.power_max_w = engine.power_max_w

    def _given(self, engine: Engine) -> tuple[Floats, Floats]:
        power_w = np.array(engine.line_power_w)
        if engine.line_speed_rpm is None:
            speed_rpm = np.full_like(self.power_w, np.nan)
        else:
            speed_rpm = np.interp(self.power_w, power_w, engine.line_speed_rpm)
        return speed_rpm, np.interp(self.power_w, power_w, np.array(engine.line_fuel_g_per_s))

    def _from_map(self, engine: Engine) -> tuple[Floats, Floats]:
        most_w = _most_w(engine)
        if most_w < engine.power_max_w * (1.0 - RATED_SHARE):
            raise InputError(
                f"engine.power_max_w: {engine.power_max_w:.0f} W is above the "
                f"{most_w:.0f} W that torque_max_nm allows"
            )
        power_w = np.minimum(self.power_w, most_w)
        speed_rpm = _candidates_rpm(engine, power_w)
        reaches = _limit_w(engine, speed_rpm) >= power_w[:, None] - ROUNDING_W
        fuel_w = np.where(reaches, fuel_power_w(engine, speed_rpm, self.power_w[:, None]), np.inf)
        best = (np.arange(len(power_w)), fuel_w.argmin(axis=1))
        return speed_rpm[best], fuel_w[best] / engine.lhv_j_per_kg * 1e3


def _limit_w(engine: Engine, speed_rpm: ArrayLike) -> Floats:
    """Largest power at a speed, tau_max(N) omega(N)."""
    speed = np.asarray(speed_rpm, dtype=float)
    torque = np.interp(speed, _of_map(engine.torque_speed_rpm), _of_map(engine.torque_max_nm))
    return np.asarray(torque * speed * RAD_PER_S)


def _breakpoints_rpm(engine: Engine) -> Floats:
    """Speeds of both tables within the range that they share; linear between."""
    tables = (_of_map(engine.friction_speed_rpm), _of_map(engine.torque_speed_rpm))
    low, high = max(table[0] for table in tables), min(table[-1] for table in tables)
    inner = {speed for table in tables for speed in table if low < speed < high}
    return np.array([low, *sorted(inner), high])


def _most_w(engine: Engine) -> float:
    """Largest power at any speed: of each stretch a quadratic in N."""
    edges = _breakpoints_rpm(engine)
    vertices = _vertices_rpm(edges, _limit_w(engine, edges))
    return float(_limit_w(engine, np.append(edges, vertices)).max())


def _vertices_rpm(edges_rpm: Floats, edges_w: Floats) -> Floats:
    """Where (c + s (N - N_0)) N is stationary between edges; shape (stretches,), clipped."""
    begin, end = edges_rpm[:-1], edges_rpm[1:]
    at = edges_w / edges_rpm  # c at each edge
    slope = np.diff(at) / (end - begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = 0.5 * (begin - at[:-1] / slope)
    return np.clip(np.where(slope == 0.0, begin, vertex), begin, end)


def _candidates_rpm(engine: Engine, power_w: Floats) -> Floats:
    """Speeds one of which is best: edges, stationary friction, and where the limit is P.

    Friction K(N) N and limit tau_max(N) omega(N) are quadratics in N on each stretch, so the
    least of f(N, P) subject to the limit is at one of these. Shape (powers, candidates).
    """
    edges = _breakpoints_rpm(engine)
    stationary = _vertices_rpm(edges, fuel_power_w(engine, edges, 0.0))
    begin, end = edges[:-1], edges[1:]
    torque = _limit_w(engine, edges) / (edges * RAD_PER_S)
    slope = np.diff(torque) / (end - begin)
    # slope N^2 + (torque_0 - slope N_0) N = P / rad_per_s, by the root that is stable for slope 0
    linear = torque[:-1] - slope * begin
    aim = power_w[:, None] / RAD_PER_S
    root = np.sqrt(np.maximum(linear**2 + 4.0 * slope * aim, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = 2.0 * aim / (linear + root)
        falling = 2.0 * aim / (linear - root)
    at_limit = [np.clip(np.where(np.isfinite(x), x, begin), begin, end) for x in (rising, falling)]
    fixed = np.broadcast_to(np.append(edges, stationary), (len(power_w), 2 * len(edges) - 1))
    return np.concatenate([fixed, *at_limit], axis=1)


@lru_cache(maxsize=LINES_KEPT)
def optimal_line(engine: Engine) -> OptimalLine:
    """Return the optimal line of an engine, kept for the next user; its arrays are read-only.

    Raises
    ------
    InputError
        If the torque limit does not allow the rated power.
    """
    line = OptimalLine(engine)
    for array in (line.power_w, line.speed_rpm, line.torque_nm, line.fuel_g_per_s):
        array.flags.writeable = False
    return line


def alpha(cold: ColdEngine, t_cl_degc: ArrayLike) -> NDArray[np.float64]:
    """Cold multiplier of fuel, alpha(T) = 1 + k ((T_hot - T)/span)^e below T_hot, else 1.

    Source: paper eq. (5) and its Fig. 2 for the shape. Array in, array out, dimensionless.
    """
    below = np.maximum(cold.hot_degc - np.asarray(t_cl_degc, dtype=float), 0.0)
    return 1.0 + cold.k * (below / cold.span_k) ** cold.exponent


def alpha_at(cold: ColdEngine, t_cl_degc: float) -> float:
    """`alpha` at one temperature (the plant's fast path)."""
    if t_cl_degc >= cold.hot_degc:
        return 1.0
    return 1.0 + cold.k * float(((cold.hot_degc - t_cl_degc) / cold.span_k) ** cold.exponent)
