"""Requirements of physics, independent of the numbers: monotonicity, closed forms, units."""

from collections.abc import Iterator

import numpy as np

from qpmpc.closed_loop import drive
from qpmpc.codegen.implementation import mh_qp
from qpmpc.controllers.balance import rule_based
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.preview import Stages
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp
from qpmpc.qp.coolant import thermostat_step
from qpmpc.solvers.names import make_solver
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.independent.equations import Equations

CYCLE = "nycc"
SAME, TABLES = 1e-9, 1e-3
STAGES_TRIED, THERMOSTAT_K = 2000, 1e-4
NOISE_G = 0.02  # a controller of finite accuracy may be off by this between two cases
FREE_RAMP_W_PER_S = 1e6  # the largest that a vehicle may have
NO_HEAT: dict[str, object] = {
    "cold_engine.k": 0.0,
    "thermal.cabin_heat_w": 0.0,
    "thermal.t_cl_min_degc": -90.0,
    "battery.derating_share_per_k": 0.0,
    "chassis.road_load_share_per_k": 0.0,
}
# so much coolant that nothing heats it
NO_HOT_LIMIT: dict[str, object] = {"thermal.heat_capacity_j_per_k": 1e9}


def _fuel_g(vehicle: Vehicle, rules: ControllerSettings | None = None) -> float:
    """SOC-balanced fuel of `mh-qp`; of the rules where their settings are given."""
    trip = Trip(CYCLE, vehicle)
    driver = mh_qp(trip) if rules is None else rule_based(trip, rules)
    return drive(trip, driver).fuel_soc_balanced_g


def monotone(context: Context) -> Iterator[Check]:
    """Colder air, more cabin heat and more auxiliary load never save fuel."""
    cases = {
        "Colder air": ("thermal.t_amb_degc", (20.0, -7.0, -20.0)),
        "More cabin heat": ("thermal.cabin_heat_w", (0.0, 1500.0, 3000.0)),
        "More auxiliary power": ("battery.aux_power_w", (0.0, 400.0, 1000.0)),
    }
    for title, (key, values) in cases.items():
        fuel = [_fuel_g(context.vehicle.with_settings({key: value})) for value in values]
        yield Check(
            f"{title} costs fuel",
            f"SOC-balanced fuel of mh-qp on {CYCLE} does not fall from one case to the next.",
            NOISE_G,
            -float(np.min(np.diff(fuel))),
            "g",
            ", ".join(f"{key}={v:g}: {f:.2f} g" for v, f in zip(values, fuel, strict=True)),
        )


def uncoupled(context: Context) -> Iterator[Check]:
    """With nothing that cold changes in engine, cabin, battery and road, weather is nothing."""
    fuel = [
        _fuel_g(context.vehicle.with_settings({**NO_HEAT, "thermal.t_amb_degc": t}))
        for t in (-7.0, 20.0)
    ]
    yield Check(
        "No thermal coupling",
        "With alpha = 1, no heat demand, and a battery and a road that know no cold fuel does not "
        "depend on the weather.",
        TABLES,
        abs(fuel[0] / fuel[1] - 1.0),
        "relative",
        f"{fuel[0]:.4f} g at -7 C, {fuel[1]:.4f} g at 20 C",
    )


def thermostat_exact(context: Context) -> Iterator[Check]:
    """Coolant over long stages in which the thermostat opens or closes."""
    thermal, equations = context.vehicle.thermal, Equations(context.vehicle)
    rng = np.random.default_rng(7)
    duration = rng.choice([1.0, 20.0, 60.0, 200.0], STAGES_TRIED)
    start, heat = rng.uniform(75.0, 91.0, STAGES_TRIED), rng.uniform(-15e3, 30e3, STAGES_TRIED)
    after = np.vectorize(equations.coolant_after_degc)
    opens = thermal.thermostat_open_degc
    end, per_heat, per_start = thermostat_step(thermal, duration, start - opens, heat)
    step_w, step_k = 1.0, 1e-5
    by_heat = after(duration, start, heat + step_w) - after(duration, start, heat - step_w)
    by_start = after(duration, start + step_k, heat) - after(duration, start - step_k, heat)
    worst = max(
        float(np.abs(opens + end - after(duration, start, heat)).max()),
        float(np.abs(per_heat - by_heat / (2.0 * step_w)).max() * 1e3),
        float(np.abs(per_start - by_start / (2.0 * step_k)).max()),
    )
    opened = np.count_nonzero((start < opens) & (per_start < 1.0))
    closed = np.count_nonzero((start > opens) & (end < 0.0))
    yield Check(
        "Thermostat within a stage",
        "Coolant at the end of a stage, and its change for a kW or a kelvin more, are those of the "
        "two linear regimes one after the other.",
        THERMOSTAT_K,
        worst,
        "K",
        f"{STAGES_TRIED} stages of 1 to 200 s; it opens in {opened}, closes in {closed}",
    )


def constant_demand(context: Context) -> Iterator[Check]:
    """Constant demand, hot engine: the QP's optimum is known in closed form.

    With the engine on for the share sigma at power p and the battery even over the trip,
    sigma G(P0 - p) + (1 - sigma) l(P0) = 0, so that

        fuel rate = min_p f(p) l(P0) / (l(P0) - G(P0 - p))
    """
    vehicle = context.vehicle.with_settings({**NO_HEAT, **NO_HOT_LIMIT})
    model, equations = PwaModel.of(vehicle), Equations(vehicle)
    n, duration = 20, 600.0
    qp = StageQp(vehicle, model, n, QpSettings(regularisation=1e-9), ScalingSettings())
    worst, shown = 0.0, []
    for net_w in (1000.0, 4000.0, 9000.0, 20000.0):
        off_w = float(equations.internal_w(vehicle.trip.soc_mean, net_w))
        fields = (duration / n, net_w, 10.0, off_w, 0.0, net_w, off_w, 0.0, 0.0, 0.0)
        stages = Stages(*(np.full(n, value) for value in fields))
        about = Linearisation.constant(n, 50.0)
        data = qp.update(stages, vehicle.trip.soc_init, 50.0, about)
        solver = make_solver("piqp", 1e-9)
        solver.setup(qp.structure, data)
        z = solver.solve(data, None, None, cold=True).primal
        rate = float(data.q @ z) / data.scaling.cost / duration
        p = np.arange(net_w, vehicle.engine.power_max_w, 1.0)
        p = p[p <= net_w + equations.charge_max_w]
        burnt = np.max(np.multiply.outer(p, model.fuel.slope) + model.fuel.intercept, axis=1)
        line = np.multiply.outer(net_w - p, model.battery.slope) + model.battery.intercept
        share = off_w / (off_w - line.max(axis=1))
        expected = float(np.min(np.where((share > 0.0) & (share <= 1.0), share * burnt, np.inf)))
        worst = max(worst, abs(rate / expected - 1.0))
        shown.append(f"{net_w / 1e3:g} kW: {rate:.5f} g/s, expected {expected:.5f}")
    yield Check(
        "Constant demand",
        "The QP's fuel rate at constant demand is that of the closed form.",
        2e-4,
        worst,
        "relative",
        "; ".join(shown),
    )


def engine_covers_demand(context: Context) -> Iterator[Check]:
    """The engine gives exactly the demand: SOC stays, fuel is the curve's."""
    from qpmpc.vehicle import Command, Plant, PlantState

    vehicle, equations = context.vehicle, Equations(context.vehicle)
    plant = Plant(vehicle)
    aux, trip = vehicle.battery.aux_power_w, vehicle.trip
    alpha = float(equations.alpha(trip.t_cl_init_degc))
    worst = 0.0
    for power in np.arange(1000.0, 70000.0, 2300.0):
        # it has been running at this power: no start takes fuel, and no ramp is in the way
        state = PlantState(trip.soc_init, trip.t_cl_init_degc, True, p_eng_w=float(power))
        after, flows = plant.step(state, Command(True, power), power - aux, 15.0)
        expected = float(equations.fuel_g_per_s(power)[0]) * alpha * plant.step_s
        worst = max(worst, abs(after.soc - state.soc), abs(flows.fuel_g / expected - 1.0))
    yield Check(
        "No battery use",
        "With P_eng = P_d + P_aux the SOC stays and the fuel is alpha(T) f(P_d + P_aux).",
        1e-3,
        worst,
        "",
        "the plant's fuel table, 50 W apart, against the map itself",
    )


def dimensions(context: Context) -> Iterator[Check]:
    """Units and sizes: double the heating value, or the whole car."""
    vehicle = context.vehicle
    base = _fuel_g(vehicle, ControllerSettings())
    richer: dict[str, object] = {  # a start takes the same heat
        "engine.lhv_j_per_kg": 2.0 * vehicle.engine.lhv_j_per_kg,
        "engine.start_fuel_g": 0.5 * vehicle.engine.start_fuel_g,
    }
    half = _fuel_g(vehicle.with_settings(richer), ControllerSettings())
    yield Check(
        "Double heating value",
        "Fuel of twice the heating value is burnt in exactly half the mass.",
        SAME,
        abs(2.0 * half / base - 1.0),
        "relative",
        f"rule-based on {CYCLE}: {base:.4f} and {half:.4f} g",
    )
    larger, rules = _twice(vehicle)
    double = _fuel_g(larger, rules)
    yield Check(
        "Car of twice the size",
        "With every mass, force, power, capacity and conductance doubled, fuel doubles.",
        TABLES,
        abs(0.5 * double / base - 1.0),
        "relative",
        f"rule-based on {CYCLE}: {double:.4f} g; the fuel table keeps its 50 W",
    )


def _twice(vehicle: Vehicle) -> tuple[Vehicle, ControllerSettings]:
    doubled = {
        "chassis": (
            "mass_kg", "road_load_a_n", "road_load_b_n_per_mps", "road_load_c_n_per_mps2"
        ),
        "engine": (
            "displacement_l", "power_max_w", "power_min_w", "torque_max_nm",
            "start_fuel_g", "start_energy_j", "ramp_w_per_s",
        ),
        "thermal": (
            "heat_capacity_j_per_k", "ua0_w_per_k", "ua1_w_per_k_per_mps",
            "radiator_w_per_k", "cabin_heat_w",
        ),
        "battery": (
            "capacity_ah", "power_discharge_max_w", "power_charge_max_w", "aux_power_w"
        ),
    }  # fmt: skip
    changes: dict[str, object] = {}
    for section, keys in doubled.items():
        for key in keys:
            value = getattr(getattr(vehicle, section), key)
            is_table = isinstance(value, tuple)
            changes[f"{section}.{key}"] = tuple(2.0 * v for v in value) if is_table else 2.0 * value
    if vehicle.engine.ramp_w_per_s == FREE_RAMP_W_PER_S:  # none for twice the engine either
        del changes["engine.ramp_w_per_s"]
    for key in ("resistance_discharge_ohm", "resistance_charge_ohm"):
        changes[f"battery.{key}"] = tuple(0.5 * r for r in getattr(vehicle.battery, key))
    rules = ControllerSettings().rule_based
    powers = ("k_soc_w", "on_w", "off_w", "power_min_w", "heat_power_w")
    wider: dict[str, object] = {f"rule_based.{key}": 2.0 * getattr(rules, key) for key in powers}
    return vehicle.with_settings(changes), ControllerSettings().with_settings(wider)
