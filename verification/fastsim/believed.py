"""A car of FASTSim in the terms of `qpmpc.Vehicle`: what controllers believe of it.

All of it is computed from FASTSim's own vehicle, at run time.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from qpmpc.settings import validated
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.vehicle.engine_parameters import LINE, LINE_TOO, MAP
from qpmpc.vehicle.section import SPEED_MAX_MPS
from qpmpc.verification.fastsim.heat import heat_of
from qpmpc.verification.fastsim.one_second import (
    PRIUS,
    Model,
    SecondBySecond,
    Tree,
    best_power_w,
    component,
    parameters,
)

Floats = NDArray[np.float64]

OPEN_CIRCUIT_V = 200.0  # any: FASTSim's battery has energy and efficiency, but no voltage
# Between these points of FASTSim's efficiency curve fuel bends: so many lines each.
LINES = 12
# Left of it fuel is concave in power: 8 % efficient when nearly idle, yet without any fuel idling.
LINE_FROM = 0.015  # of the greatest power
SAMPLES = 200
POWER_SHARE_MAX = 0.9  # of the most that a battery with this resistance can give
PROBED_MPS = (20.0, 20.5)  # speeds of the second in which FASTSim's road load is read


def believed_vehicle(
    engine_of: Vehicle | None = None, model: Model = PRIUS, t_amb_degc: float | None = None
) -> Vehicle:
    """Return a car of FASTSim as controllers are to see it.

    What cannot be expressed is fitted: the losses of motor and battery together become the
    resistances of a battery, by least squares over +-`best_power_w` (`_resistances_ohm`); the
    engine's line goes on straight below `LINE_FROM`; for heat see `heat_of`. There is no start
    cost, as in FASTSim; once started the engine runs as long as FASTSim's own control lets it.

    Parameters
    ----------
    engine_of : the car that gives the engine's fuel; FASTSim's own efficiency curve if None
    model : which car
    t_amb_degc : of the air; None for that of `heat_of`, and where the car has no heat
    """
    car = parameters(model)
    engine, motor, battery = (component(car, name) for name in ("fc", "em", "res"))
    base = (load_vehicle() if engine_of is None else engine_of).model_dump()
    aux_w = float(car["pwr_aux_base_watts"])
    discharge_ohm, charge_ohm = _resistances_ohm(car)
    heat = heat_of(model, t_amb_degc)
    content = {
        "name": model.believed
        + ("" if engine_of is None else f"-with-{engine_of.name}")[: 64 - len(model.believed)],
        "description": f"FASTSim's {car['name']} as controllers believe it to be, engine of "
        + ("FASTSim" if engine_of is None else engine_of.name),
        "chassis": _chassis(model, car),
        "engine": base["engine"],
        "cold_engine": base["cold_engine"] | heat.cold_engine,
        "thermal": base["thermal"] | heat.thermal,
        "battery": {
            "capacity_ah": battery["energy_capacity_joules"] / 3600.0 / OPEN_CIRCUIT_V,
            "soc_grid": (0.0, 1.0),
            "open_circuit_v": (OPEN_CIRCUIT_V,) * 2,
            "resistance_discharge_ohm": (discharge_ohm,) * 2,
            "resistance_charge_ohm": (charge_ohm,) * 2,
            "power_discharge_max_w": min(
                motor["pwr_out_max_watts"] + aux_w,
                POWER_SHARE_MAX * 0.25 * OPEN_CIRCUIT_V**2 / discharge_ohm,
            ),
            "power_charge_max_w": motor["pwr_out_max_watts"] - aux_w,
            "soc_min": battery["min_soc"],
            "soc_max": battery["max_soc"],
            "aux_power_w": aux_w,
        },
        "trip": {
            # where FASTSim's `run` starts
            "soc_init": 0.5 * (battery["min_soc"] + battery["max_soc"]),
            "t_cl_init_degc": heat.t_cl_init_degc,
            "eta_eq": _eta_eq(car, heat.hot_share),
        },
    }
    ramp_w_per_s = engine["pwr_out_max_watts"] / engine["pwr_ramp_lag_seconds"]
    power_max_w = engine["pwr_out_max_watts"]
    if engine_of is None:
        content["engine"] |= _line(car, base["engine"], heat.hot_share)
    else:
        power_max_w = min(power_max_w, base["engine"]["power_max_w"])
    content["engine"] |= {
        "power_max_w": power_max_w,
        "ramp_w_per_s": ramp_w_per_s,
        "start_fuel_g": 0.0,
        "start_energy_j": 0.0,
        "min_on_s": round(component(car, "pt_cntrl")["RGWDB"]["fc_min_time_on_seconds"]),
        "min_off_s": 0,
        "electric_max_mps": SPEED_MAX_MPS,  # FASTSim has no such limit
    }
    return validated(
        Vehicle, content, f"the plant {model.plant}, with the engine of {base['name']}"
    )


def _chassis(model: Model, car: Tree) -> Tree:
    """Road load of FASTSim, read in a second that it drives."""
    before_mps, after_mps = PROBED_MPS
    middle_mps = 0.5 * (before_mps + after_mps)
    battery = component(car, "res")
    probe = SecondBySecond(model, 0.5 * (battery["min_soc"] + battery["max_soc"]), before_mps)
    power_w = probe.drive(after_mps, 0.0, None)["state"]
    inertia_w = power_w["pwr_accel_watts"] + power_w["pwr_whl_inertia_watts"]
    mass_kg, eta = car["mass_kilograms"], component(car, "transmission")["eff_interp"]
    return {
        "mass_kg": mass_kg,
        "rotating_mass_factor": inertia_w / (mass_kg * (after_mps - before_mps) * middle_mps),
        "road_load_a_n": power_w["pwr_rr_watts"] / middle_mps,
        "road_load_b_n_per_mps": 0.0,
        "road_load_c_n_per_mps2": power_w["pwr_drag_watts"] / middle_mps**3,
        "eta_drive": eta,
        "eta_regen": eta,
    }


def _line(car: Tree, engine: Tree, hot_share: float) -> Tree:
    """Fuel of the hot engine from FASTSim's efficiency curve, P / (eta(P) LHV)."""
    curve = component(car, "fc")["eff_interp_from_pwr_out"]["data"]
    most_w = component(car, "fc")["pwr_out_max_watts"]
    grid = np.array(curve["grid"][0])
    ends = grid[grid >= LINE_FROM]
    steps = np.arange(len(ends), step=1.0 / LINES)
    share = np.interp(steps[steps <= len(ends) - 1], np.arange(len(ends)), ends)
    efficiency = np.interp(share, grid, curve["values"]) * hot_share
    fuel = share * most_w / efficiency / engine["lhv_j_per_kg"] * 1e3
    power = share * most_w
    idle = fuel[0] - power[0] * (fuel[1] - fuel[0]) / (power[1] - power[0])
    return {
        **dict.fromkeys((*MAP, *LINE_TOO)),
        LINE[0]: (0.0, *power.tolist()),
        LINE[1]: (float(idle), *fuel.tolist()),
        "power_min_w": float(power[0]),
    }


def stored_w(car: Tree, net_w: Floats) -> Floats:
    """Power that FASTSim draws from the battery's store where the road and aux ask for net_w.

    The motor has the efficiency of its curve in driving and, as FASTSim has it, that of no power
    in charging; the battery a constant one, or one by hourly rate, then at its coldest.
    """
    motor = component(car, "em")
    curve = motor["eff_interp_achieved"]["data"]
    aux_w = car["pwr_aux_base_watts"]
    shaft_w = net_w - aux_w
    share = np.maximum(shaft_w, 0.0) / motor["pwr_out_max_watts"]
    motor_eta = np.interp(share, curve["grid"][0], curve["values"])
    electric_w = np.where(shaft_w > 0.0, shaft_w / motor_eta, shaft_w * motor_eta) + aux_w
    eta = _battery_eta(component(car, "res"), electric_w)
    return np.asarray(np.where(electric_w > 0.0, electric_w / eta, electric_w * eta))


def _battery_eta(battery: Tree, electric_w: Floats) -> Floats:
    """Efficiency of a battery, which in FASTSim is the same there and back at one rate."""
    model = battery["eff_interp"]
    if "Constant" in model:
        return np.full_like(electric_w, model["Constant"])
    data = model["CRateTemperature"]["data"]
    coldest = np.reshape(data["values"], (len(data["grid"][0]), -1))[:, 0]
    per_hour = electric_w * 3600.0 / battery["energy_capacity_joules"]
    return np.asarray(np.interp(per_hour, data["grid"][0], coldest))


def _resistances_ohm(car: Tree) -> tuple[float, float]:
    """Resistances in discharge and in charge whose losses are nearest to motor's and battery's.

    min_R sum (P + R I^2 - stored_w(P))^2 over P up to the engine's best power, which is what the
    battery is given where the engine alone works, and what it gives in its place.
    """
    net_w = np.linspace(0.0, best_power_w(car), SAMPLES + 1)[1:]
    found = []
    for sign in (1.0, -1.0):
        want_w, asked_w = stored_w(car, sign * net_w), sign * net_w

        def off(r_per_v2: float, want_w: Floats = want_w, asked_w: Floats = asked_w) -> float:
            drawn_w = (1.0 - np.sqrt(1.0 - 4.0 * r_per_v2 * asked_w)) / (2.0 * r_per_v2)
            return float(np.sum((drawn_w - want_w) ** 2))

        most = 0.25 / net_w[-1]
        best = minimize_scalar(off, bounds=(1e-4 * most, most * (1.0 if sign > 0 else 10.0)),
                               method="bounded", options={"xatol": 1e-6 * most})  # fmt: skip
        found.append(float(best.x) * OPEN_CIRCUIT_V**2)
    return found[0], found[1]


def _eta_eq(car: Tree, hot_share: float) -> float:
    """Share of the fuel's energy that reaches the store from the hot engine at its best."""
    engine = component(car, "fc")["eff_interp_from_pwr_out"]["data"]["values"]
    charging = component(car, "em")["eff_interp_achieved"]["data"]["values"][0]
    electric_w = np.array(-best_power_w(car) * charging)
    kept = _battery_eta(component(car, "res"), electric_w)
    return float(max(engine) * hot_share * charging * kept)
