"""Safety layer: makes any one-step command admissible, in closed form."""

from qpmpc.trip import Observation
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.heat import cooling_w
from qpmpc.vehicle.plant import Command, Plant

SOC_MARGIN = 1e-5  # kept from the lower limit; the result of a step is known exactly there
T_CL_MARGIN_K = 0.02  # kept from the upper limit; the result of a step is known exactly there
T_CL_COOLING_K = 0.15  # a step with the engine off cools the coolant by less than this
T_CL_NEAR_K = 2.0  # no step warms the coolant by more than this
BISECTIONS = 20  # of the engine power range: to some 0.05 W


class SafetyLayer:
    """Corrects a command so that the next second keeps power, SOC and coolant limits.

    Whatever the optimiser returned, the result is finite and in range. In order of priority:
    battery and engine power limits; SOC limits; coolant limits.

    Parameters
    ----------
    plant : gives limits and one-step heat flows; its state is never touched
    heat_power_w : engine power when it runs for heat alone
    """

    def __init__(self, plant: Plant, heat_power_w: float = 4000.0) -> None:
        self._plant = plant
        self._vehicle = plant.vehicle
        self._heat_power_w = heat_power_w

    def admissible(self, wish: Command, seen: Observation) -> Command:
        """Return the admissible command nearest to `wish`."""
        battery, engine = self._vehicle.battery, self._vehicle.engine
        net_w = seen.demand_w + battery.aux_power_w
        least, most = self._battery_range_w(seen.soc)
        low = max(net_w - most, 0.0)  # engine power without which the battery gives too much
        high = min(net_w - least, engine.power_max_w)
        on, p_eng = wish.engine_on, wish.p_eng_w
        if not p_eng >= 0.0:  # negative or nan
            p_eng = 0.0
        if self._too_cold(seen) and not on:
            on, p_eng = True, self._heat_power_w
        if on:
            p_eng = min(p_eng, self._cooling_limit_w(seen))
        if low > 0.0:
            on = True
        if not on or high < engine.power_min_w:
            # Braking at the charge limit leaves no room for the engine: it must be off.
            return Command(False, 0.0)
        return Command(True, min(max(p_eng, low, engine.power_min_w), high))

    def _battery_range_w(self, soc: float) -> tuple[float, float]:
        """Terminal power that the battery may take and give in the next second."""
        battery, step_s = self._plant.battery, self._plant.step_s
        most = battery.discharge_limit_w(soc - SOC_MARGIN, step_s)
        return -battery.charge_limit_w(soc, step_s), most

    def _too_cold(self, seen: Observation) -> bool:
        """Whether a second with the engine off would reach the lower coolant limit."""
        return seen.t_cl_degc < self._vehicle.thermal.t_cl_min_degc + T_CL_COOLING_K

    def _cooling_limit_w(self, seen: Observation) -> float:
        """Engine power that just warms the coolant to its upper limit within the step."""
        plant, thermal = self._plant, self._vehicle.thermal
        room_k = thermal.t_cl_max_degc - T_CL_MARGIN_K - seen.t_cl_degc
        if room_k > T_CL_NEAR_K:
            return self._vehicle.engine.power_max_w
        out_w = cooling_w(thermal, seen.t_cl_degc, seen.speed_mps)
        storing_w = room_k * thermal.heat_capacity_j_per_k / plant.step_s
        return self._power_for_heat_w(out_w + storing_w, seen.t_cl_degc)

    def _power_for_heat_w(self, heat_w: float, t_cl_degc: float) -> float:
        """Largest engine power whose heat into the coolant is at most `heat_w` (bisection)."""
        low, high = 0.0, self._vehicle.engine.power_max_w
        factor = alpha_at(self._vehicle.cold_engine, t_cl_degc)
        factor *= self._vehicle.engine.lhv_j_per_g
        share = 1.0 - self._vehicle.thermal.exhaust_share
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            heat = share * (factor * self._plant.line.fuel.at(middle) - middle)
            low, high = (middle, high) if heat <= heat_w else (low, middle)
        return low
