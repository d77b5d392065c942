"""Monitor of measurements: what is not plausible is replaced by what the model expects.

The same in C: codegen/runtime/mpc_check.c. Described in docs/safety.md.
"""

from enum import IntFlag
from math import nan

from qpmpc.trip import Observation
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.plant import LONG_AGO_S, Command, Plant

LONGEST_GAP_S = 20  # seconds that may be missed; beyond, or backwards, the clock is wrong


class Flag(IntFlag):
    """What was wrong in a second; the values are those of generated C."""

    BAD_MEASUREMENT = 1  # of soc, t_cl_degc, engine_on, demand_w, speed_mps; fuel_g if it is read
    BAD_PREVIEW = 2  # the last good one is used as long as it reaches
    SOLVER_FAILED = 4  # no usable solution
    WARMING_UP = 8  # the solver has not converged yet since a cold start
    BAD_CLOCK = 16  # a second again, or one that cannot be: then seconds are counted on
    BAD_STATE = 32  # memory of the C controller was not initialised, or was corrupted
    BAD_CALIBRATION = 64  # of the C controller: numbers refused, the last good ones are in use

    def names(self) -> list[str]:
        """Return the flags in words."""
        return [str(flag.name).lower().replace("_", " ") for flag in self]


NOTHING_WRONG = Flag(0)


class InputMonitor:
    """Checks every measurement against what the car can do, and replaces what fails.

    A measured SOC or coolant temperature is plausible if the car could have got there from the
    value that the model predicts from the last good one: the reach grows with the seconds since.
    Else the prediction is used. Demand and speed are plausible if the car can do them; else the
    last good ones are used. Time is counted on where the clock is wrong. The seconds since the
    engine was started or stopped, and its power in the last second, are known from what was
    measured and commanded before.

    Parameters
    ----------
    plant : of the car; its state is never touched

    Attributes
    ----------
    fuel_most_g : more fuel than a second can take, of a controller that reads the fuel injected;
        what is not plausible becomes not a number. None: it is not read, and not checked
    """

    fuel_most_g: float | None = None

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._can = Capability.of(plant.vehicle, plant.line)
        self._power_max_w = plant.vehicle.engine.power_max_w
        self.forget()

    def forget(self) -> None:
        """Forget everything, as after a restart: the first measurement is only range-checked."""
        trip = self._plant.vehicle.trip
        self._good = Observation(0, trip.soc_init, trip.t_cl_init_degc, False, 0.0, 0.0)
        self._soc_since_s = self._t_cl_since_s = LONG_AGO_S
        self._clock: int | None = None
        self._command = Command(False, 0.0)

    def commanded(self, command: Command) -> None:
        """Take note of the command of this second, for the next prediction."""
        self._command = command

    def checked(self, seen: Observation) -> tuple[Observation, Flag]:
        """Return the observation to be used, and what was wrong with the one given."""
        elapsed, flags = self._elapsed(seen.step)
        first = self._clock is None
        step = seen.step if first else self._good.step + elapsed
        self._clock = seen.step
        soc, t_cl_degc = self._predicted(elapsed)
        can, since = self._can, min(self._soc_since_s + elapsed, LONG_AGO_S)
        reach = (since + 1) * can.soc_per_s
        good_soc = 0.0 <= seen.soc <= 1.0 and abs(seen.soc - soc) <= reach
        self._soc_since_s = 0 if good_soc else since
        since = min(self._t_cl_since_s + elapsed, LONG_AGO_S)
        reach = (since + 1) * can.t_cl_k_per_s
        good_t_cl = (
            can.coldest_degc <= seen.t_cl_degc <= can.hottest_degc
            and abs(seen.t_cl_degc - t_cl_degc) <= reach
        )
        self._t_cl_since_s = 0 if good_t_cl else since
        good_demand = can.demand_min_w <= seen.demand_w <= can.demand_max_w
        good_speed = 0.0 <= seen.speed_mps <= can.speed_max_mps
        fuel_g, most_g = seen.fuel_g, self.fuel_most_g
        good_fuel = most_g is None or 0.0 <= fuel_g <= most_g
        if not (good_soc and good_t_cl and good_demand and good_speed and good_fuel):
            flags |= Flag.BAD_MEASUREMENT
        engine_for_s, p_eng_before_w = self._engine_before(seen, elapsed, first)
        self._good = Observation(
            step,
            seen.soc if good_soc else soc,
            seen.t_cl_degc if good_t_cl else t_cl_degc,
            bool(seen.engine_on),
            seen.demand_w if good_demand else self._good.demand_w,
            seen.speed_mps if good_speed else self._good.speed_mps,
            engine_for_s,
            p_eng_before_w,
            fuel_g if good_fuel else nan,
        )
        return self._good, flags

    def _engine_before(self, seen: Observation, elapsed: int, first: bool) -> tuple[int, float]:
        """Seconds since the engine was started or stopped, and its power in the last second.

        It was started or stopped with the last command, if at all. Nothing is known at first, nor
        of the power of an engine that runs without a command.
        """
        good, command = self._good, self._command
        if first:
            for_s = LONG_AGO_S
        elif bool(seen.engine_on) == good.engine_on:
            for_s = min(good.engine_for_s + elapsed, LONG_AGO_S)
        else:
            for_s = max(elapsed, 1)
        if not seen.engine_on:
            return for_s, 0.0
        if good.engine_on and elapsed == 0:  # the same second: its first command does not count
            return for_s, good.p_eng_before_w
        return for_s, command.p_eng_w if command.engine_on else self._power_max_w

    def _elapsed(self, step: int) -> tuple[int, Flag]:
        """Seconds since the last call, one where the clock cannot be believed."""
        if self._clock is None:
            return 0, NOTHING_WRONG
        elapsed = step - self._clock
        if not 0 <= elapsed <= LONGEST_GAP_S:
            return 1, Flag.BAD_CLOCK
        return elapsed, NOTHING_WRONG if elapsed else Flag.BAD_CLOCK

    def _predicted(self, elapsed: int) -> tuple[float, float]:
        """SOC and coolant temperature that a second of the last command led to."""
        good, command = self._good, self._command
        if elapsed == 0:
            return good.soc, good.t_cl_degc
        vehicle, maps, h = self._plant.vehicle, self._plant.battery, self._plant.step_s
        aux_w, thermal = vehicle.battery.aux_power_w, vehicle.thermal
        start_fuel_g = 0.0
        if command.engine_on and not good.engine_on:
            start_fuel_g = vehicle.engine.start_fuel_g
            aux_w += vehicle.engine.start_energy_j / h
        p_bat = good.demand_w + aux_w - command.p_eng_w
        accepted = self._plant.charge_limit_w(good.soc)
        if p_bat < -accepted:  # the brakes take what the battery cannot
            p_bat = min(-accepted, aux_w - command.p_eng_w) if good.demand_w < 0.0 else p_bat
        soc = good.soc - h * maps.current_a(good.soc, p_bat) / maps.charge_c
        heat_w = -cooling_w(thermal, good.t_cl_degc, good.speed_mps)
        if command.engine_on:
            hot_g_per_s = self._plant.line.fuel.at(command.p_eng_w)
            fuel_g = h * alpha_at(vehicle.cold_engine, good.t_cl_degc) * hot_g_per_s + start_fuel_g
            fuel_w = fuel_g / h * vehicle.engine.lhv_j_per_g
            heat_w += engine_w(thermal, fuel_w, command.p_eng_w)
        t_cl_degc = good.t_cl_degc + h * heat_w / thermal.heat_capacity_j_per_k
        return min(max(soc, 0.0), 1.0), min(
            max(t_cl_degc, self._can.coldest_degc), self._can.hottest_degc
        )
