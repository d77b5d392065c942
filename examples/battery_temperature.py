"""The battery's temperature in our program: a state of its own, heated by I2R, and a limit.

The car has no such sensor: the planner estimates the temperature from the SOC that it sees.
"""

import cvxpy as cp
import numpy as np

import qpmpc

# ASSUMED: a small pack cooled by the air of the cabin, at departure as warm as that.
HEAT_CAPACITY_J_PER_K, COOLING_W_PER_K, CABIN_DEGC = 14e3, 4.0, 25.0
LIMIT_DEGC, PRICE_G_PER_K_S = 26.5, 0.2  # a soft limit: braking is not asked
CAR = qpmpc.load_vehicle("prius-liion")


def heated_degc(t_degc, current_a, seconds=1.0):
    """Return the temperature after some seconds at a current."""
    heat_w = CAR.battery.resistance_charge_ohm[1] * current_a**2
    loss_w = COOLING_W_PER_K * (t_degc - CABIN_DEGC)
    return t_degc + seconds * (heat_w - loss_w) / HEAT_CAPACITY_J_PER_K


def current_a(soc_before, soc):
    """Return the mean current of a second in which SOC has changed."""
    return (soc_before - soc) * CAR.battery.capacity_ah * 3600.0


class CoolBattery(qpmpc.CvxpyPlanner):
    name = "cool-battery"

    def terms(self, program):
        volts = np.interp(0.6, CAR.battery.soc_grid, CAR.battery.open_circuit_v)
        ohm = CAR.battery.resistance_charge_ohm[1]
        self.t_bat = program.state("t_bat")
        heat_w = cp.Variable(program.stages, name="heat")
        too_hot_k = cp.Variable(program.stages, name="too_hot", nonneg=True)
        duration_s = program.given("duration_s")
        # R (G / U)^2 from below by tangents, so that the program stays a QP; tight where it counts
        tangents = [
            heat_w / 1e2 >= ohm / volts**2 * (2.0 * at_w * program.internal_w - at_w**2) / 1e2
            for at_w in np.linspace(-16e3, 16e3, 9)
        ]
        loss_w = COOLING_W_PER_K * (self.t_bat.before - CABIN_DEGC)
        rise_k = cp.multiply(duration_s / HEAT_CAPACITY_J_PER_K, heat_w - loss_w)
        return PRICE_G_PER_K_S * (duration_s @ too_hot_k), [
            *tangents,
            self.t_bat.end == self.t_bat.before + rise_k,
            self.t_bat.end <= LIMIT_DEGC + too_hot_k,
        ]

    def depart(self, seen):
        super().depart(seen)
        self.t_degc, self.soc = CABIN_DEGC, seen.soc

    def plan(self, seen):
        self.t_degc = heated_degc(self.t_degc, current_a(self.soc, seen.soc))
        self.soc = seen.soc
        self.t_bat.now.value = self.t_degc
        return super().plan(seen)


def hottest_degc(run):
    """Return the highest temperature of the battery, by the same model, as driven."""
    t_degc = hottest = CABIN_DEGC
    for before, after in zip(run.trajectory.soc, run.trajectory.soc[1:], strict=False):
        t_degc = heated_degc(t_degc, current_a(before, after))
        hottest = max(hottest, t_degc)
    return hottest


runs = qpmpc.compare("nycc", ["mh-qp", CoolBattery], CAR, figures={"hottest_degC": hottest_degc})
print(runs)
