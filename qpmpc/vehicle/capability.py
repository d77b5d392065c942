"""What a car can do: bounds on measurements and previews, in Python and in generated C alike."""

from dataclasses import dataclass

import numpy as np

from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.demand import GRAVITY_MPS2
from qpmpc.vehicle.engine import OptimalLine, alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import BOILING_DEGC

COLDEST_MEASURED_DEGC = -60.0
FASTEST = 1.5  # downhill, relative to the speed that full power holds on the level
SPEED_STEP_MPS = 0.1
STRONGEST = 2.0  # demand that a driver may ask for, relative to what engine and battery give
GRIP = 1.2  # of the tyres, in weights
ROUNDING_W = 1.0  # of means of many seconds in single precision


@dataclass(frozen=True)
class Capability:
    """Bounds that a true measurement or preview of this car keeps.

    Attributes
    ----------
    hottest_degc, coldest_degc : of the coolant
    soc_per_s, t_cl_k_per_s : largest change of the states in a second
    demand_min_w, demand_max_w : of the demand: full braking; twice what engine and battery give
    speed_max_mps : top speed
    net_min_w, net_max_w : of the mean net power P0 of a long stage
    internal_min_w, internal_max_w : of the mean battery power with the engine off of a long stage
    energy_j : of a full battery, at the voltage of the initial SOC
    """

    hottest_degc: float
    coldest_degc: float
    soc_per_s: float
    t_cl_k_per_s: float
    demand_min_w: float
    demand_max_w: float
    speed_max_mps: float
    net_min_w: float
    net_max_w: float
    internal_min_w: float
    internal_max_w: float
    energy_j: float

    @classmethod
    def of(cls, vehicle: Vehicle, line: OptimalLine) -> "Capability":
        """Compute the bounds of a car with this optimal line."""
        battery, engine = vehicle.battery, vehicle.engine
        maps = BatteryMaps(battery)
        limits_w = (vehicle.battery_discharge_max_w, -vehicle.battery_charge_max_w)
        edges = (battery.soc_min, battery.soc_max)
        current = max(abs(maps.current_a(soc, power)) for soc in edges for power in limits_w)
        most_w = vehicle.battery_discharge_max_w + engine.power_max_w
        fastest = FASTEST * _level_speed_mps(vehicle, most_w)
        weight_n = vehicle.chassis.mass_kg * GRAVITY_MPS2
        at_mean = vehicle.trip.soc_mean  # the SOC of l(P0) in a preview
        inner = [float(maps.internal_power_w(at_mean, p)) for p in limits_w]
        return cls(
            hottest_degc=BOILING_DEGC,
            coldest_degc=COLDEST_MEASURED_DEGC,
            soc_per_s=current / maps.charge_c,
            t_cl_k_per_s=_fastest_k_per_s(vehicle, line, fastest),
            demand_min_w=-(GRIP * weight_n * fastest) * vehicle.chassis.eta_regen - ROUNDING_W,
            demand_max_w=STRONGEST * most_w,
            speed_max_mps=fastest,
            net_min_w=-vehicle.battery_charge_max_w - ROUNDING_W,
            net_max_w=most_w + ROUNDING_W,
            internal_min_w=inner[1] - ROUNDING_W,
            internal_max_w=inner[0] + ROUNDING_W,
            energy_j=maps.energy_j(at_mean),
        )


def _level_speed_mps(vehicle: Vehicle, power_w: float) -> float:
    """Largest speed at which the road load takes no more than this power."""
    chassis = vehicle.chassis
    speed = np.arange(0.0, 150.0, SPEED_STEP_MPS)
    drag = chassis.road_load_b_n_per_mps * speed + chassis.road_load_c_n_per_mps2 * speed**2
    load_w = (chassis.road_load_a_n + drag) * speed / chassis.eta_drive
    return float(speed[load_w <= power_w].max())


def _fastest_k_per_s(vehicle: Vehicle, line: OptimalLine, speed_mps: float) -> float:
    """Largest change of the coolant: cold engine at full power, or boiling and engine off."""
    engine, thermal = vehicle.engine, vehicle.thermal
    factor = alpha_at(vehicle.cold_engine, COLDEST_MEASURED_DEGC) * engine.lhv_j_per_g
    fuel_g = float(line.fuel_g_per_s[-1]) + engine.start_fuel_g
    heating_w = engine_w(thermal, factor * fuel_g, engine.power_max_w)
    warming_w = cooling_w(thermal, COLDEST_MEASURED_DEGC, speed_mps)  # negative
    cooling = cooling_w(thermal, BOILING_DEGC, speed_mps)
    return max(heating_w - min(warming_w, 0.0), cooling) / thermal.heat_capacity_j_per_k
