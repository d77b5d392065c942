"""Heat of FASTSim's cars in the terms of `qpmpc.Vehicle`: engine, cabin, air.

FASTSim's engine is the less efficient the colder it is, 1 - exp(-(T - T0)/lag) of what its curve
says; a share of its losses warms it in the second after; it cools while the car stands, and once
the thermostat has opened a little on the road, too. A controller of its own (PID) takes from it
what keeps the cabin at its set temperature.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from qpmpc.vehicle.engine_parameters import COLD_FACTOR_MAX, COLDEST_DEGC
from qpmpc.verification.fastsim.one_second import (
    ZERO_DEGC_K,
    Model,
    SecondBySecond,
    Tree,
    component,
    parameters,
)

Floats = NDArray[np.float64]

# A car without heat: its engine is always this warm, with so much heat capacity that it stays.
T_CL_DEGC = 88.0
HEAT_CAPACITY_J_PER_K = 1e9
WITHOUT_T_AMB_DEGC = 20.0
# A heated one, where nothing else is said: 20 F, EPA's cold test.
T_AMB_DEGC = -7.0
CABIN_DEGC = 22.0  # what FASTSim's cars depart at, and keep in the cabin
T_CL_MAX_DEGC = 150.0  # FASTSim has no upper limit; its own control gets to 141 °C on HWFET
# What depends on speed is that of town: so much of the time standing, the rest at this speed.
STANDING, TOWN_MPS = 0.2, 15.0
SAMPLES = 100
K_MAX = 5.0  # of the cold multiplier


@dataclass(frozen=True)
class Heat:
    """What controllers believe of a car's heat.

    Attributes
    ----------
    cold_engine, thermal : of these sections of a vehicle
    t_cl_init_degc : of the coolant at departure
    hot_share : of the engine's efficiency curve that is left where it counts as hot
    """

    cold_engine: Tree
    thermal: Tree
    t_cl_init_degc: float
    hot_share: float = 1.0


def heat_of(model: Model, t_amb_degc: float | None = None) -> Heat:
    """Return what controllers believe of the heat of a car of FASTSim.

    Of a heated car: lowest temperature and that at departure are those at which FASTSim's control
    lets a cold engine run and stop; hot is where its thermostat is open; losses and the cabin's
    demand are read in seconds that it drives, the demand at the lower end of the set temperature.

    Parameters
    ----------
    model : which car
    t_amb_degc : of the air; None for `T_AMB_DEGC`; without effect on a car without heat
    """
    if not model.heated:
        return Heat(
            {"k": 0.0},
            {
                "heat_capacity_j_per_k": HEAT_CAPACITY_J_PER_K,
                "t_amb_degc": WITHOUT_T_AMB_DEGC,
                "cabin_heat_w": 0.0,
                "t_cl_min_degc": T_CL_DEGC - 20.0,
                "t_cl_max_degc": T_CL_DEGC + 20.0,
            },
            T_CL_DEGC,
        )
    t_amb_degc = T_AMB_DEGC if t_amb_degc is None else t_amb_degc
    car = parameters(model)
    rules, engine, hvac = (
        component(car, "pt_cntrl")["RGWDB"],
        component(car, "fc_heat"),
        component(car, "hvac"),
    )
    opens_degc, span_k = (
        engine["tstat_te_sto_kelvin"] - ZERO_DEGC_K,
        engine["tstat_te_delta_kelvin"],
    )
    coldest_degc = rules["temp_fc_forced_on_kelvin"] - ZERO_DEGC_K
    hot_degc = opens_degc + span_k
    closed_w_per_k, cabin_w_per_k = _lost_w_per_k(model, opens_degc - span_k, t_amb_degc)
    open_w_per_k, _ = _lost_w_per_k(model, hot_degc + span_k, t_amb_degc)
    inside_degc = hvac["te_set_kelvin"] - hvac["te_deadband_kelvin"] - ZERO_DEGC_K
    return Heat(
        _cold_engine(engine["fc_eff_model"]["Exponential"], coldest_degc, hot_degc),
        {
            "heat_capacity_j_per_k": engine["heat_capacitance_joules_per_kelvin"],
            "exhaust_share": 1.0 - engine["max_frac_from_comb"],
            "ua0_w_per_k": closed_w_per_k,
            "ua1_w_per_k_per_mps": 0.0,
            "thermostat_open_degc": opens_degc,
            "thermostat_span_k": span_k,
            "radiator_w_per_k": open_w_per_k - closed_w_per_k,
            "t_amb_degc": t_amb_degc,
            "cabin_heat_w": cabin_w_per_k * max(inside_degc - t_amb_degc, 0.0),
            "t_cl_min_degc": coldest_degc,
            "t_cl_max_degc": T_CL_MAX_DEGC,
        },
        rules["temp_fc_allowed_off_kelvin"] - ZERO_DEGC_K,
        float(efficiency_left(engine["fc_eff_model"]["Exponential"], hot_degc)),
    )


def efficiency_left(curve: Tree, t_degc: float | Floats) -> Floats:
    """Share of its efficiency that an engine of this temperature has, as FASTSim has it."""
    above_k = np.asarray(t_degc) + ZERO_DEGC_K - curve["offset"]
    return np.asarray(np.maximum(1.0 - np.exp(-above_k / curve["lag"]), curve["minimum"]))


def _cold_engine(curve: Tree, coldest_degc: float, hot_degc: float) -> Tree:
    """Cold multiplier 1 + k ((T_hot - T)/span)^e nearest to FASTSim's between its limits.

    By least squares of the relative error in k; e is the steepest that a vehicle may have,
    alpha(`COLDEST_DEGC`) = `COLD_FACTOR_MAX`, because FASTSim's exponential is steeper still.
    """
    t_degc = np.linspace(coldest_degc, hot_degc, SAMPLES)
    want = efficiency_left(curve, hot_degc) / efficiency_left(curve, t_degc)
    span_k = hot_degc - coldest_degc
    reach = np.log((hot_degc - COLDEST_DEGC) / span_k)

    def exponent(k: float) -> float:
        return float(np.log((COLD_FACTOR_MAX - 1.0) / k) / reach)

    def off(k: float) -> float:
        found = 1.0 + k * ((hot_degc - t_degc) / span_k) ** exponent(k)
        return float(np.sum((found / want - 1.0) ** 2))

    k = float(minimize_scalar(off, bounds=(0.01, K_MAX), method="bounded").x)
    return {"k": k, "hot_degc": hot_degc, "span_k": span_k, "exponent": exponent(k) - 1e-9}


def _lost_w_per_k(model: Model, t_cl_degc: float, t_amb_degc: float) -> tuple[float, float]:
    """Conductances of engine and cabin to the air in town, with the engine at a temperature."""
    battery = component(parameters(model), "res")
    soc = 0.5 * (battery["min_soc"] + battery["max_soc"])
    lost = []
    for speed_mps in (0.0, TOWN_MPS):
        probe = SecondBySecond(model, soc, speed_mps, t_cl_degc, t_amb_degc)
        cabin_k = component(probe.car, "cabin")["state"]["temperature_kelvin"] - ZERO_DEGC_K
        now = probe.drive(speed_mps, 0.0, None)
        engine_w = component(now, "fc_heat")["state"]["pwr_thrml_to_amb_watts"]
        cabin_w = -component(now, "cabin")["state"]["pwr_thrml_from_amb_watts"]
        lost.append((engine_w / (t_cl_degc - t_amb_degc), cabin_w / (cabin_k - t_amb_degc)))
    engine, cabin = (STANDING * a + (1.0 - STANDING) * b for a, b in zip(*lost, strict=True))
    return float(engine), float(cabin)
