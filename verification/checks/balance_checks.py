"""Balances of closed-loop runs: power, charge, fuel and heat, second by second."""

from collections.abc import Iterator

import numpy as np

from qpmpc.closed_loop import drive
from qpmpc.controllers.balance import rule_based
from qpmpc.cycles import Cycle
from qpmpc.results import Run
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.independent.equations import Equations, Floats

EXACT = 1e-9
TABLE_STEP_W = 50.0


def _imbalances(run: Run, cycle: Cycle) -> dict[str, tuple[Floats, Floats]]:
    """Both sides of each balance, second by second, recomputed from the trajectory."""
    tr, vehicle, eq = run.trajectory, run.vehicle, Equations(run.vehicle)
    th, engine = vehicle.thermal, vehicle.engine
    soc, t = tr.soc[:-1], tr.t_cl_degc[:-1]
    net = eq.demand_w(cycle) + vehicle.battery.aux_power_w
    current = -np.diff(tr.soc) * eq.charge_c
    grid = np.arange(0.0, engine.power_max_w + TABLE_STEP_W, TABLE_STEP_W)
    grid = np.unique(grid.clip(max=engine.power_max_w))
    burnt = np.interp(tr.p_eng_w, grid, eq.fuel_g_per_s(grid)) * eq.alpha(t) * tr.engine_on
    begins = np.diff(tr.engine_on.astype(float), prepend=0.0) > 0.0
    speed = 0.5 * (cycle.speed_mps[1:] + cycle.speed_mps[:-1])
    heat = (1.0 - th.exhaust_share) * (tr.fuel_g * eq.lhv_j_per_g - tr.p_eng_w)
    lost = eq.ua_w_per_k(speed) * (t - th.t_amb_degc) + eq.cabin_w(t) + eq.radiator_w(t)
    stored = np.diff(tr.t_cl_degc) * th.heat_capacity_j_per_k
    return {
        "power, eq. (2)": (
            tr.p_eng_w + tr.p_bat_w,
            net + tr.p_friction_w + begins * engine.start_energy_j,
        ),
        "charge, eq. (1)": (eq.terminal_w(soc, current), tr.p_bat_w),
        "heat, eq. (3)": (stored, heat - lost),
        "fuel, eqs. (4, 5)": (tr.fuel_g, burnt + begins * engine.start_fuel_g),
    }


def books_balance(context: Context) -> Iterator[Check]:
    """Every flow of every second is accounted for, with equations written independently."""
    for loop in context.loops:
        rules = drive(loop.trip, rule_based(loop.trip, context.settings))
        for run in (loop.run, rules):
            for name, (a, b) in _imbalances(run, loop.trip.cycle).items():
                yield Check(
                    f"Balance of {name}, {run.controller}, {run.cycle}",
                    "Both sides agree in every second, relative to the largest value of the trip.",
                    EXACT,
                    float(np.max(np.abs(a - b)) / np.max(np.abs(b))),
                    "relative",
                )


def limits_kept(context: Context) -> Iterator[Check]:
    """Limits of SOC, coolant and power, from the trajectory alone."""
    for loop in context.loops:
        tr, battery, th = loop.run.trajectory, context.vehicle.battery, context.vehicle.thermal
        engine, equations = context.vehicle.engine, Equations(context.vehicle)
        excess = {
            "SOC": _beyond(tr.soc, battery.soc_min, battery.soc_max),
            "coolant, K": _beyond(tr.t_cl_degc, th.t_cl_min_degc, th.t_cl_max_degc),
            "battery, W": _beyond(tr.p_bat_w, -equations.charge_max_w, equations.discharge_max_w),
            "engine, W": _beyond(tr.p_eng_w, 0.0, engine.power_max_w),
            "its ramp, W": _beyond(np.diff(tr.p_eng_w, prepend=0.0), -np.inf, engine.ramp_w_per_s),
        }
        worst = max(excess, key=lambda name: excess[name])
        yield Check(
            f"Limits, {loop.name}",
            "No limit of SOC, coolant, battery or engine is exceeded.",
            1e-6,
            excess[worst],
            "",
            f"SOC {tr.soc.min():.3f} .. {tr.soc.max():.3f}, coolant {tr.t_cl_degc.min():.1f} .. "
            f"{tr.t_cl_degc.max():.1f} C",
        )
        yield Check(
            f"Final SOC, {loop.name}",
            "The trip ends within 1 % of the SOC asked for, its first if none is (paper eq. 11).",
            0.01,
            abs(float(tr.soc[-1]) / context.vehicle.trip.soc_target - 1.0),
            "relative",
            f"{tr.soc[0]:.4f} to {tr.soc[-1]:.4f}",
        )


def _beyond(values: Floats, low: float, high: float) -> float:
    return float(max(low - values.min(), values.max() - high, 0.0))
