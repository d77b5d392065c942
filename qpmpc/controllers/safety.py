"""Safety layer: the command of one second that keeps the limits, else comes nearest to them.

Statement, assumptions and proof: docs/safety.md. The same in C: codegen/runtime/mpc_safety.c.
"""

from bisect import bisect_right
from math import inf
from typing import NamedTuple

from qpmpc.trip import Observation
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.engine_parameters import Engine
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.must_run import too_fast
from qpmpc.vehicle.plant import Command, Plant

# Kept from the limits where that is possible, and always from the ramp: rounding, in single
# precision too, stays inside.
POWER_MARGIN_W = 0.1
SOC_MARGIN = 1e-5
T_CL_MARGIN_K = 0.004


class Interval(NamedTuple):
    """Engine powers, W, that keep one pair of limits."""

    low_w: float
    high_w: float

    def distance_w(self, p_eng_w: float) -> float:
        """Distance of a power from the interval; 0 inside."""
        return max(self.low_w - p_eng_w, p_eng_w - self.high_w, 0.0)

    def narrowed(self, to: "Interval") -> "Interval":
        """Part of the interval inside another; if there is none, its nearest point."""
        return Interval(
            min(max(self.low_w, to.low_w), self.high_w),
            max(min(self.high_w, to.high_w), self.low_w),
        )

    def raised(self, by_w: float) -> "Interval":
        """The interval with its lower end raised, to the upper one at most."""
        return Interval(min(self.low_w + by_w, self.high_w), self.high_w)


def greatest_w(engine: Engine, seen: Observation, step_s: float) -> float:
    """Greatest power of the engine in the coming second: its own, or what the ramp leads to."""
    before_w = seen.p_eng_before_w if seen.engine_on else 0.0
    ramped_w = before_w + engine.ramp_w_per_s * step_s - POWER_MARGIN_W
    return max(min(ramped_w, engine.power_max_w), engine.power_min_w)


class SafetyLayer:
    """Corrects a command so that the next second keeps power, SOC and coolant limits.

    Whatever the optimiser returned, the result is finite and in range, the engine is on where the
    car is too fast for one that is off, and no other such command exceeds the limits by less:
    first battery and engine power, then SOC, then coolant; where all are kept, in the same order
    the limits drawn in by a margin. Of such commands it takes the one nearest to the wish: the same
    on or off where possible, then the nearest power. While the shortest run or rest of the engine
    is not over, the wish is that it goes on as it does.

    Parameters
    ----------
    plant : gives limits and one-step heat flows; its state is never touched
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._vehicle = plant.vehicle
        self._fuel_g_per_s: list[float] = plant.line.fuel_g_per_s.tolist()
        self._power_w: list[float] = plant.line.power_w.tolist()

    def admissible(self, wish: Command, seen: Observation) -> Command:
        """Return the admissible command nearest to `wish`."""
        engine = self._vehicle.engine
        heat = _EngineHeat(self, seen)
        running = Interval(engine.power_min_w, greatest_w(engine, seen, self._plant.step_s))
        cranking_w = 0.0 if seen.engine_on else engine.start_energy_j / self._plant.step_s
        on_excess: list[float] = []
        off_excess: list[float] = []
        for margin in (False, True):
            for allowed in (self._battery_w(seen, margin), self._soc_w(seen, margin)):
                allowed_on = allowed.raised(cranking_w)
                running = running.narrowed(allowed_on)
                on_excess.append(allowed_on.distance_w(running.low_w))
                off_excess.append(allowed.distance_w(0.0))
            allowed_heat = self._heat_w(seen, margin)
            if allowed_heat.low_w <= 0.0 and heat.most_w <= allowed_heat.high_w:
                on_excess.append(0.0)  # kept at any power and without the engine: the usual case
                off_excess.append(0.0)
                continue
            by_heat = Interval(*map(heat.power_w, allowed_heat))
            running = running.narrowed(by_heat)
            kept = by_heat.low_w <= running.low_w <= by_heat.high_w  # whatever rounding leaves
            on_excess.append(0.0 if kept else allowed_heat.distance_w(heat.of(running.low_w)))
            off_excess.append(allowed_heat.distance_w(0.0))
        wish_on, wanted_w = self._lasting(wish, seen)
        on = wish_on if on_excess == off_excess else on_excess < off_excess
        on = on or too_fast(self._vehicle, seen.speed_mps)
        if not on:
            return Command(False, 0.0)
        return Command(True, min(max(wanted_w, running.low_w), running.high_w))

    def _lasting(self, wish: Command, seen: Observation) -> tuple[bool, float]:
        """Engine on or off, and its power if on; as before while its shortest run or rest lasts."""
        engine = self._vehicle.engine
        shortest_s = engine.min_on_s if seen.engine_on else engine.min_off_s
        lasts = seen.engine_for_s < shortest_s
        wanted_w = wish.p_eng_w if wish.engine_on and wish.p_eng_w >= 0.0 else 0.0  # nor nan
        if lasts and seen.engine_on and not wish.engine_on:
            is_known = seen.p_eng_before_w < engine.power_max_w
            wanted_w = seen.p_eng_before_w if is_known else 0.0
        return bool(seen.engine_on if lasts else wish.engine_on), wanted_w

    def _battery_w(self, seen: Observation, margin: bool) -> Interval:
        """Engine powers at which the battery's power stays in its limits.

        Friction brakes take braking power that the battery cannot: while braking it has to take
        no more than P_eng - P_aux. Here as for SOC the power that cranks a starting engine is left
        out: it raises the lower end (`Interval.raised`), but never helps to discharge.
        """
        battery = self._vehicle.battery
        net_w, drawn_w = seen.demand_w + battery.aux_power_w, POWER_MARGIN_W * margin
        return Interval(
            net_w - self._vehicle.battery_discharge_max_w + drawn_w,
            max(net_w, battery.aux_power_w) + self._vehicle.battery_charge_max_w - drawn_w,
        )

    def _soc_w(self, seen: Observation, margin: bool) -> Interval:
        """Engine powers after which SOC lies in its limits."""
        battery, maps, step_s = self._vehicle.battery, self._plant.battery, self._plant.step_s
        net_w, aux_w = seen.demand_w + battery.aux_power_w, battery.aux_power_w
        drawn = SOC_MARGIN * margin
        emptying_w = maps.power_to_reach_w(seen.soc, battery.soc_min + drawn, step_s)
        # far below: as fast as can be
        emptying_w = max(emptying_w, -self._vehicle.battery_charge_max_w)
        filling_w = maps.power_to_reach_w(seen.soc, battery.soc_max - drawn, step_s)
        if filling_w <= 0.0:
            high_w = max(net_w, aux_w) - filling_w
        else:  # too full: to be discharged by the demand; while braking, not to be charged
            high_w = net_w - filling_w if net_w > 0.0 else aux_w
        return Interval(min(net_w - emptying_w, high_w), high_w)

    def _heat_w(self, seen: Observation, margin: bool) -> Interval:
        """Heat of the engine after which the coolant lies in its limits."""
        thermal = self._vehicle.thermal
        out_w = cooling_w(thermal, seen.t_cl_degc, seen.speed_mps)
        w_per_k = thermal.heat_capacity_j_per_k / self._plant.step_s
        drawn_k = T_CL_MARGIN_K * margin
        low_k = thermal.t_cl_min_degc + drawn_k - seen.t_cl_degc
        high_k = thermal.t_cl_max_degc - drawn_k - seen.t_cl_degc
        return Interval(out_w + low_k * w_per_k, out_w + high_k * w_per_k)


class _EngineHeat:
    """Heat of the running engine into the coolant in one second, and its inverse.

    Q(P) = (1 - x) [LHV (alpha f(P) + m_start / h) - P], increasing in P because fuel power grows
    by more than shaft power.
    """

    def __init__(self, layer: SafetyLayer, seen: Observation) -> None:
        vehicle, plant = layer._vehicle, layer._plant
        engine = vehicle.engine
        self._factor = alpha_at(vehicle.cold_engine, seen.t_cl_degc) * engine.lhv_j_per_g
        self._thermal = vehicle.thermal
        starting_g_per_s = 0.0 if seen.engine_on else engine.start_fuel_g / plant.step_s
        self._start_w = engine_w(vehicle.thermal, engine.lhv_j_per_g * starting_g_per_s, 0.0)
        self._fuel, self._fuel_g_per_s = plant.line.fuel, layer._fuel_g_per_s
        self._line_w = layer._power_w
        self.most_w = self.of(engine.power_max_w)

    def of(self, p_eng_w: float) -> float:
        """Heat, W, at an engine power."""
        fuel_w = self._factor * self._fuel.at(p_eng_w)
        return self._start_w + engine_w(self._thermal, fuel_w, p_eng_w)

    def _at(self, i: int) -> float:
        fuel_w = self._factor * self._fuel_g_per_s[i]
        return self._start_w + engine_w(self._thermal, fuel_w, self._line_w[i])

    def power_w(self, heat_w: float) -> float:
        """Engine power that gives this heat; infinite where none does."""
        if heat_w < self._at(0):
            return -inf
        above = bisect_right(range(len(self._line_w)), heat_w, key=self._at)
        if above == len(self._line_w):
            return inf if heat_w > self._at(above - 1) else self._line_w[-1]
        low_w, high_w = self._line_w[above - 1], self._line_w[above]
        share = (heat_w - self._at(above - 1)) / (self._at(above) - self._at(above - 1))
        return low_w + share * (high_w - low_w)
