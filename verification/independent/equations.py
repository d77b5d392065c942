"""The plant's equations written a second time, from its parameters alone.

The checks compare the product with these; nothing here calls the product's own maps.
"""

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpmpc.cycles import Cycle
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

SPEED_STEP_RPM = 0.05
GRAVITY_MPS2 = 9.81
BATTERY_WEAKER_BELOW_DEGC = 10.0


class Equations:
    """Maps and balances of one vehicle, for arrays.

    Parameters
    ----------
    vehicle : parameters
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.lhv_j_per_g = vehicle.engine.lhv_j_per_kg / 1000.0
        self.charge_c = vehicle.battery.capacity_ah * 3600.0
        battery, colder_k = vehicle.battery, BATTERY_WEAKER_BELOW_DEGC - vehicle.thermal.t_amb_degc
        weaker = battery.derating_share_per_k * np.clip(colder_k, 0.0, None)
        # of a battery as cold as the air; there is no other use of the rated limits
        self.discharge_max_w = float((1.0 - weaker) * battery.power_discharge_max_w)
        self.charge_max_w = float((1.0 - weaker) * battery.power_charge_max_w)

    def demand_w(self, cycle: Cycle) -> Floats:
        """P_d, eq. (2), from the speed at both ends of each second."""
        car, v = self.vehicle.chassis, cycle.speed_mps
        mean = (v[:-1] + v[1:]) / 2.0
        grade = cycle.step_grade
        below_k = 24.0 - self.vehicle.thermal.t_amb_degc
        cold = 1.0 + max(car.road_load_share_per_k * below_k, 0.0)
        force = (
            np.where(mean > 0.0, car.road_load_a_n, 0.0) * cold
            + mean * cold * (car.road_load_b_n_per_mps + car.road_load_c_n_per_mps2 * mean)
            + car.mass_kg * car.rotating_mass_factor * (v[1:] - v[:-1])
            + car.mass_kg * GRAVITY_MPS2 * np.sin(np.arctan(grade))
        )
        regen = np.full(len(mean), car.eta_regen)
        if car.regen_full_mps > 0.0:
            regen *= np.interp(mean, [car.regen_from_mps, car.regen_full_mps], [0.0, 1.0])
        factor = np.where(force * mean < 0.0, regen, 1.0 / car.eta_drive)
        return np.asarray(force * mean * factor)

    def net_w(self, cycle: Cycle) -> Floats:
        """P0 = P_d + P_aux within the limits of battery and engine."""
        battery = self.vehicle.battery
        net = self.demand_w(cycle) + battery.aux_power_w
        net = np.maximum(net, -self.charge_max_w)
        return np.minimum(net, self.discharge_max_w + self.vehicle.engine.power_max_w)

    def fuel_g_per_s(self, power_w: ArrayLike) -> Floats:
        """Fuel rate of the hot engine, on: least over speed within the torque limit; shape (m,)."""
        engine = self.vehicle.engine
        power = np.atleast_1d(np.asarray(power_w, dtype=float))
        if engine.line_power_w is not None and engine.line_fuel_g_per_s is not None:
            return np.asarray(np.interp(power, engine.line_power_w, engine.line_fuel_g_per_s))
        assert engine.indicated_efficiency is not None
        most_w, friction_w = self._friction
        needed = np.minimum(power, most_w.max())
        # the least friction of all speeds that reach as much, and that of the lowest such speed,
        # which is between two of the grid
        order = np.argsort(-most_w, kind="stable")
        least_w = np.minimum.accumulate(friction_w[order])
        reaching = np.searchsorted(-most_w[order], -needed, side="right")
        rising = slice(0, int(most_w.argmax()) + 1)
        lowest_w = np.interp(needed, most_w[rising], friction_w[rising])
        drawn_w = np.minimum(least_w[reaching - 1], lowest_w)
        return np.asarray((drawn_w + power / engine.indicated_efficiency) / self.lhv_j_per_g)

    @cached_property
    def _friction(self) -> tuple[Floats, Floats]:
        """Largest power and friction power at each speed of a grid."""
        engine = self.vehicle.engine
        assert engine.friction_speed_rpm is not None
        assert engine.friction_kj_per_rev_l is not None
        assert engine.torque_speed_rpm is not None
        assert engine.torque_max_nm is not None
        assert engine.displacement_l is not None
        low = max(engine.friction_speed_rpm[0], engine.torque_speed_rpm[0])
        high = min(engine.friction_speed_rpm[-1], engine.torque_speed_rpm[-1])
        rpm = np.linspace(low, high, round((high - low) / SPEED_STEP_RPM) + 1)
        torque = np.interp(rpm, engine.torque_speed_rpm, engine.torque_max_nm)
        most_w = torque * rpm * np.pi / 30.0
        # litres per second, times the friction work of a litre and revolution
        swept = engine.displacement_l * rpm / 60.0
        friction_w = (
            1000.0 * swept * np.interp(rpm, engine.friction_speed_rpm, engine.friction_kj_per_rev_l)
        )
        return most_w, friction_w

    def alpha(self, t_cl_degc: ArrayLike) -> Floats:
        """Cold multiplier."""
        cold = self.vehicle.cold_engine
        below = np.clip(cold.hot_degc - np.asarray(t_cl_degc, dtype=float), 0.0, None)
        return np.asarray(1.0 + cold.k * np.power(below / cold.span_k, cold.exponent))

    def voltage_v(self, soc: ArrayLike) -> Floats:
        """U_oc."""
        battery = self.vehicle.battery
        found = np.interp(np.asarray(soc, dtype=float), battery.soc_grid, battery.open_circuit_v)
        return np.asarray(found)

    def resistance_ohm(self, soc: ArrayLike, discharging: ArrayLike) -> Floats:
        """R by direction."""
        battery = self.vehicle.battery
        give = np.interp(
            np.asarray(soc, dtype=float), battery.soc_grid, battery.resistance_discharge_ohm
        )
        take = np.interp(
            np.asarray(soc, dtype=float), battery.soc_grid, battery.resistance_charge_ohm
        )
        return np.asarray(np.where(discharging, give, take))

    def terminal_w(self, soc: ArrayLike, current_a: ArrayLike) -> Floats:
        """Terminal power of a current, U I - R I^2, discharge positive."""
        current = np.asarray(current_a, dtype=float)
        resistance = self.resistance_ohm(soc, current >= 0.0)
        return np.asarray(current * (self.voltage_v(soc) - resistance * current))

    def internal_w(self, soc: ArrayLike, power_w: ArrayLike) -> Floats:
        """G = U I, with I the smaller root of R I^2 - U I + P = 0."""
        power, voltage = np.asarray(power_w, dtype=float), self.voltage_v(soc)
        resistance = self.resistance_ohm(soc, power >= 0.0)
        ratio = 4.0 * resistance * power / voltage**2
        # 2 P / (1 + root) is U I without the difference of nearly equal numbers
        return np.asarray(2.0 * power / (1.0 + np.sqrt(np.maximum(1.0 - ratio, 0.0))))

    def ua_w_per_k(self, speed_mps: ArrayLike) -> Floats:
        """Conductance to the air."""
        th = self.vehicle.thermal
        return np.asarray(th.ua0_w_per_k + th.ua1_w_per_k_per_mps * np.asarray(speed_mps))

    def cabin_w(self, t_cl_degc: ArrayLike) -> Floats:
        """Heat to the cabin."""
        th = self.vehicle.thermal
        fades = [th.cabin_heat_from_degc, th.cabin_heat_full_degc]
        t = np.asarray(t_cl_degc, dtype=float)
        return np.asarray(np.interp(t, fades, [0.0, th.cabin_heat_w]))

    def coolant_after_degc(self, duration_s: float, t_cl_degc: float, heat_w: float) -> float:
        """T after a stage of constant heat in which the thermostat opens or closes.

        The radiator's heat grows linearly from zero at T_open to its full power at T_max; the two
        linear regimes follow one after the other.
        """
        th = self.vehicle.thermal
        capacity = th.heat_capacity_j_per_k
        full_w = th.radiator_w_per_k * (th.t_cl_max_degc - th.t_amb_degc)
        tau = capacity * th.thermostat_span_k / full_w
        rest = th.thermostat_open_degc + heat_w * tau / capacity  # where the open one settles
        left, t = duration_s, t_cl_degc
        while left > 0.0:
            is_open = t > th.thermostat_open_degc or (t == th.thermostat_open_degc and heat_w > 0.0)
            if is_open:
                t_next = rest + (t - rest) * math.exp(-left / tau)
                if t_next >= th.thermostat_open_degc:
                    return t_next
                left -= tau * math.log((t - rest) / (th.thermostat_open_degc - rest))
            else:
                t_next = t + heat_w * left / capacity
                if t_next <= th.thermostat_open_degc:
                    return t_next
                left -= (th.thermostat_open_degc - t) * capacity / heat_w
            t = th.thermostat_open_degc
        return t

    def radiator_w(self, t_cl_degc: ArrayLike) -> Floats:
        """Heat to the radiator."""
        th, t = self.vehicle.thermal, np.asarray(t_cl_degc, dtype=float)
        opens = th.thermostat_open_degc
        share = np.interp(t, [opens, opens + th.thermostat_span_k], [0.0, 1.0])
        return np.asarray(share * th.radiator_w_per_k * (t - th.t_amb_degc))
