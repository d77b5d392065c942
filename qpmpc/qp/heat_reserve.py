"""Coolant kept in reserve where an engine beside a full battery cannot heat the car."""

from qpmpc.vehicle.engine import OptimalLine, alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.parameters import Vehicle

FULL_BATTERY_S = 300.0  # standing or driving downhill; chosen in docs/choice.md
SPEED_MPS = 8.0


def heat_reserve_k(vehicle: Vehicle, line: OptimalLine) -> float:
    """Coolant temperature lost in `FULL_BATTERY_S` with the battery full and no demand, K.

    The engine then gives no more than the auxiliaries take,

        FULL_BATTERY_S (Q_out(T_min) - Q(P_aux)) / C,   Q(P) = (1 - x) (LHV alpha f(P) - P),

    0 where it can hold the temperature: with a large cabin heat or in great cold it cannot. A
    forecast that knows each demand but not its order cannot tell when that will happen.
    """
    thermal, engine = vehicle.thermal, vehicle.engine
    least = thermal.t_cl_min_degc
    power_w = min(max(vehicle.battery.aux_power_w, engine.power_min_w), engine.power_max_w)
    fuel_g_per_s = alpha_at(vehicle.cold_engine, least) * line.fuel.at(power_w)
    heat_w = engine_w(thermal, engine.lhv_j_per_g * fuel_g_per_s, power_w)
    lost_w = max(cooling_w(thermal, least, SPEED_MPS) - heat_w, 0.0)
    room_k = thermal.t_cl_max_degc - least
    return min(FULL_BATTERY_S * lost_w / thermal.heat_capacity_j_per_k, 0.5 * room_k)
