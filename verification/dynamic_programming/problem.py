"""The optimal control problem as plain arrays: the plant's numbers, demand and power limits."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.vehicle import Plant, PlantState, Vehicle, demand_w
from qpmpc.vehicle.must_run import too_fast
from qpmpc.verification.dynamic_programming.engine_states import STEP_S, EngineStates
from qpmpc.verification.dynamic_programming.kernels import (
    Bools,
    Constants,
    Floats,
    Maps,
    drift,
)
from qpmpc.verification.dynamic_programming.power_limits import PowerLimits, power_limits


@dataclass(frozen=True)
class Problem:
    """One cycle driven by one vehicle.

    Attributes
    ----------
    plant : the plant on which the result is realised
    maps, constants : its numbers for compiled code
    states : of the engine
    demand_w, speed_mps : shape (n,)
    running, starting : power of an engine that ran before, and of one that starts
    off_allowed : shape (n,)
    soc_init, t_cl_init_degc : start
    soc_end : least final SOC
    """

    plant: Plant
    maps: Maps
    constants: Constants
    states: EngineStates
    demand_w: Floats
    speed_mps: Floats
    running: PowerLimits
    starting: PowerLimits
    off_allowed: Bools
    soc_init: float
    soc_end: float
    t_cl_init_degc: float

    @cached_property
    def too_fast(self) -> Bools:
        """Whether each second is too fast for an engine that is off, shape (n,)."""
        return too_fast(self.plant.vehicle, self.speed_mps)

    @property
    def steps(self) -> int:
        """Number n of steps of 1 s."""
        return len(self.demand_w)

    def ramped_w(self, state: PlantState) -> float:
        """Greatest engine power that the ramp allows in the second after this state."""
        before_w = state.p_eng_w if state.engine_on else 0.0
        return before_w + self.plant.vehicle.engine.ramp_w_per_s * STEP_S

    def drift(self, soc: Floats, t_cl_degc: Floats) -> tuple[Floats, Floats]:
        """Sum of the changes of SOC and T in the seconds before, had the engine been off in each.

        Parameters
        ----------
        soc, t_cl_degc : states in which each second begins, shape (n,)
        """
        return drift(self.maps, self.constants, self.demand_w, self.speed_mps, soc, t_cl_degc)


def build_problem(cycle: Cycle, vehicle: Vehicle) -> Problem:
    """Tabulate plant, demand and power limits.

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
    demand = demand_w(cycle, vehicle)
    running, starting, off_allowed = power_limits(vehicle, demand, cycle.step_speed_mps)
    greatest_w = float(max(running.high_w.max(), starting.high_w.max()))
    lhv_j_per_g = engine.lhv_j_per_g
    fuel_per_soc = plant.battery.energy_j(trip.soc_target) / (trip.eta_eq * lhv_j_per_g)
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
        power_charge_max_w=vehicle.battery_charge_max_w,
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
        start_energy_j=engine.start_energy_j,
        soc_worth_g=fuel_per_soc,
        t_cl_worth_g_per_k=thermal.heat_capacity_j_per_k / lhv_j_per_g,
        energy_worth_g_per_j=1.0 / (trip.eta_eq * lhv_j_per_g),
    )
    return Problem(
        plant=plant,
        maps=maps,
        constants=constants,
        states=EngineStates.of(engine, greatest_w, len(demand)),
        demand_w=demand,
        speed_mps=cycle.step_speed_mps,
        running=running,
        starting=starting,
        off_allowed=off_allowed,
        soc_init=trip.soc_init,
        soc_end=trip.soc_target,
        t_cl_init_degc=trip.t_cl_init_degc,
    )
