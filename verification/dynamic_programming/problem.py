"""The optimal control problem as plain arrays: the plant's numbers, demand and power limits."""

from dataclasses import dataclass

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.vehicle import Plant, Vehicle, demand_w
from qpmpc.verification.dynamic_programming.kernels import Bools, Constants, Floats, Maps


@dataclass(frozen=True)
class Problem:
    """One cycle driven by one vehicle.

    Attributes
    ----------
    plant : the plant on which the result is realised
    maps, constants : its numbers for compiled code
    demand_w, speed_mps : shape (n,)
    power_low_w, power_high_w : engine power with the engine on, shape (n,)
    on_allowed, off_allowed : shape (n,)
    soc_init, t_cl_init_degc : start; soc_init is also the least final SOC
    """

    plant: Plant
    maps: Maps
    constants: Constants
    demand_w: Floats
    speed_mps: Floats
    power_low_w: Floats
    power_high_w: Floats
    on_allowed: Bools
    off_allowed: Bools
    soc_init: float
    t_cl_init_degc: float

    @property
    def steps(self) -> int:
        """Number n of steps of 1 s."""
        return len(self.demand_w)


def build_problem(cycle: Cycle, vehicle: Vehicle) -> Problem:
    """Tabulate plant, demand and power limits.

    With the engine on its power keeps the battery within its limits,

        P_d + P_aux - P_dis_max <= P_eng <= max(P_d, 0) + P_aux + P_chg_max,

    as far as its own limits allow; braking beyond the charge limit goes to the friction brakes.
    With the engine off, P_d + P_aux <= P_dis_max. Where even full engine power is not enough, the
    engine runs at full power and the excess is counted as a violation.

    Raises
    ------
    InputError
        If the trip starts outside the coolant limits, which are hard here.
    """
    plant = Plant(vehicle)
    engine, battery, thermal, trip = (
        vehicle.engine,
        vehicle.battery,
        vehicle.thermal,
        vehicle.trip,
    )
    if not thermal.t_cl_min_degc <= trip.t_cl_init_degc <= thermal.t_cl_max_degc:
        raise InputError(
            f"vehicle {vehicle.name}: trip.t_cl_init_degc: dynamic programming needs it within "
            f"thermal.t_cl_min_degc .. t_cl_max_degc, {thermal.t_cl_min_degc:g} .. "
            f"{thermal.t_cl_max_degc:g} (given: {trip.t_cl_init_degc:g})"
        )
    demand = demand_w(cycle, vehicle.chassis)
    net = demand + battery.aux_power_w
    low = np.maximum(engine.power_min_w, net - battery.power_discharge_max_w)
    high = np.minimum(
        engine.power_max_w,
        np.maximum(demand, 0.0) + battery.aux_power_w + battery.power_charge_max_w,
    )
    low = np.minimum(low, engine.power_max_w)
    on_allowed = low <= high
    off_allowed = net <= battery.power_discharge_max_w
    lhv_j_per_g = engine.lhv_j_per_g
    fuel_per_soc = plant.battery.energy_j(trip.soc_init) / (trip.eta_eq * lhv_j_per_g)
    maps = Maps(
        soc_grid=np.array(battery.soc_grid),
        open_circuit_v=np.array(battery.open_circuit_v),
        resistance_discharge_ohm=np.array(battery.resistance_discharge_ohm),
        resistance_charge_ohm=np.array(battery.resistance_charge_ohm),
        line_power_w=plant.line.power_w,
        line_fuel_g_per_s=plant.line.fuel_g_per_s,
    )
    constants = Constants(
        charge_c=plant.battery.charge_c,
        power_charge_max_w=battery.power_charge_max_w,
        aux_power_w=battery.aux_power_w,
        cold_k=vehicle.cold_engine.k,
        cold_hot_degc=vehicle.cold_engine.hot_degc,
        cold_span_k=vehicle.cold_engine.span_k,
        cold_exponent=vehicle.cold_engine.exponent,
        lhv_j_per_g=lhv_j_per_g,
        **thermal.model_dump(),
        soc_min=battery.soc_min,
        soc_max=battery.soc_max,
        start_fuel_g=engine.start_fuel_g,
        soc_worth_g=fuel_per_soc,
        t_cl_worth_g_per_k=thermal.heat_capacity_j_per_k / lhv_j_per_g,
    )
    return Problem(
        plant=plant,
        maps=maps,
        constants=constants,
        demand_w=demand,
        speed_mps=cycle.step_speed_mps,
        power_low_w=low,
        power_high_w=high,
        on_allowed=on_allowed,
        off_allowed=off_allowed | ~on_allowed,
        soc_init=trip.soc_init,
        t_cl_init_degc=trip.t_cl_init_degc,
    )
