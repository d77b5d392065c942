"""The nonlinear reference: its maps, its plans against the equations, its closed loop."""

import json
import sys
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from qpmpc.controllers.receding_horizon import PLAN_VALID_STEPS, RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import QpmpcError
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.stage_qp import StageQp
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import PlantState, Vehicle, load_vehicle
from qpmpc.verification.checks.nlp_checks import FUEL_PERCENT, PLANNED_FUEL_PERCENT
from qpmpc.verification.independent.equations import Equations
from qpmpc.verification.nonlinear.comparison import compare, compare_open_loop
from qpmpc.verification.nonlinear.driven_plan import PlanDriver
from qpmpc.verification.nonlinear.maps import RoundedTable, SmoothMaps
from qpmpc.verification.nonlinear.mh_nlp import MhNlp
from qpmpc.verification.nonlinear.problem import SOC_ROW, UNIT, NlpProblem, NlpVar
from qpmpc.verification.nonlinear.solver import NlpPlan

Floats = NDArray[np.float64]

# the engine of the paper: IPOPT takes three times as long where a start costs something
VEHICLE = load_vehicle("paper-nimh")
EQUATIONS = Equations(VEHICLE)
MAPS = SmoothMaps(VEHICLE)


@cache
def beginning(name: str, steps: int) -> Cycle:
    whole = load_cycle(name)
    inside = slice(steps + 1)
    return Cycle(name, whole.time_s[inside], whole.speed_mps[inside], whole.grade[inside])


def planner(cycle: Cycle, vehicle: Vehicle = VEHICLE) -> MhNlp:
    return MhNlp(Trip(cycle, vehicle))


def plan_of(nlp: MhNlp, step: int, soc: float, t_cl_degc: float) -> NlpPlan:
    return nlp.solve(nlp.trip.observation(step, PlantState(soc, t_cl_degc)))


@given(st.floats(0.0, 71e3))
@settings(deadline=None)
def test_fuel_map(power_w: float) -> None:
    # rounding and interpolation: the thermal and the PWA error are of the same size
    exact = float(EQUATIONS.fuel_g_per_s(power_w)[0])
    assert float(MAPS.fuel_g_per_s(power_w)) == pytest.approx(exact, abs=0.002)


@given(st.floats(0.4, 0.8), st.floats(-25e3, 27e3))
@settings(deadline=None)
def test_battery_map(soc: float, power_w: float) -> None:
    exact = float(EQUATIONS.internal_w(soc, power_w))
    # rounding over 0.01 of SOC is worth some 0.1 % of U and R, most where power is near its peak
    assert float(MAPS.internal_w(soc, power_w)) == pytest.approx(exact, abs=2.0 + 2e-3 * abs(exact))


@given(st.floats(20.0, 95.0))
@settings(deadline=None)
def test_thermal_maps(t_cl_degc: float) -> None:
    # the corners are 0.1 K deep: 14.5 kW over 5 K, alpha' 0.004 / K
    assert float(MAPS.radiator_w(t_cl_degc)) == pytest.approx(
        float(EQUATIONS.radiator_w(t_cl_degc)), abs=300.0
    )
    assert float(MAPS.alpha(t_cl_degc)) == pytest.approx(
        float(EQUATIONS.alpha(t_cl_degc)), abs=4e-4
    )
    assert float(MAPS.cabin_w(t_cl_degc)) == pytest.approx(1500.0, abs=0.1)


def test_rounded_table_keeps_convexity_and_ends() -> None:
    x, y = np.array([0.0, 1.0, 3.0, 4.0]), np.array([0.0, 0.5, 4.0, 8.0])
    table = RoundedTable(x, y, 0.1)
    at = np.linspace(-2.0, 6.0, 401)
    values = np.array([float(table(float(point))) for point in at])
    assert np.all(np.diff(values, 2) > -1e-12)
    inside = (at >= 0.0) & (at <= 4.0)
    # w / 2 times the change of slope, at each of two corners
    assert np.abs(values - np.interp(at, x, y))[inside].max() < 0.05 * (1.25 + 2.25)
    slopes = (values[1] - values[0], values[-1] - values[-2])
    np.testing.assert_allclose(np.array(slopes) / 0.02, [0.5, 4.0], atol=0.01)


def _surplus_k(
    end: float, equations: Equations, begin: float, h: float, heating: tuple[float, float, float]
) -> float:
    """Imbalance of eq. (3) over a stage, K, the thermostat following the coolant within it."""
    fuel, power, speed_mps = heating
    th, mean = equations.vehicle.thermal, 0.5 * (begin + end)
    burnt_w = equations.lhv_j_per_g * float(equations.alpha(mean)) * fuel
    heat = (1.0 - th.exhaust_share) * (burnt_w - power)
    heat -= float(equations.ua_w_per_k(speed_mps)) * (mean - th.t_amb_degc)
    heat -= float(equations.cabin_w(mean))

    def rise(_: float, t_cl: Floats) -> Floats:
        return (heat - equations.radiator_w(t_cl)) / th.heat_capacity_j_per_k

    after = solve_ivp(rise, (0.0, h), [begin], rtol=1e-6, atol=1e-6).y[0, -1] if h else begin
    return float(after) - end


def rolled(vehicle: Vehicle, plan: NlpPlan, soc: float, t_cl: float) -> tuple[float, float, float]:
    """Final SOC and coolant, and fuel, of a plan's engine powers by the exact equations."""
    equations, road, x = Equations(vehicle), plan.stages, plan.x
    fuel_g = 0.0
    for k in range(len(road.duration_s)):
        h, net, sigma = road.duration_s[k], road.net_w[k], x[k, NlpVar.ON]
        power = plan.power_on_w(k)
        drawn = sigma * equations.internal_w(soc, net - power)
        drawn += (1.0 - sigma) * road.internal_off_w[k]
        soc -= h * float(drawn) / (float(equations.voltage_v(soc)) * equations.charge_c)
        fuel = sigma * float(equations.fuel_g_per_s(power)[0])

        heating = (fuel, sigma * power, float(road.speed_mps[k]))
        end = brentq(
            _surplus_k, t_cl - 60.0, t_cl + 60.0, args=(equations, t_cl, float(h), heating)
        )
        fuel_g += h * float(equations.alpha(0.5 * (t_cl + end))) * fuel
        t_cl = end
    return soc, t_cl, fuel_g


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("nycc", {}),
        ("hwfet", {"trip.t_cl_init_degc": 88.0}),
        ("udds", {"trip.t_cl_init_degc": 41.0, "trip.soc_init": 0.5}),
    ],
)
def test_plan_obeys_the_exact_equations(name: str, changes: dict[str, object]) -> None:
    vehicle = VEHICLE.with_settings(changes)
    nlp = planner(beginning(name, 400), vehicle)
    plan = plan_of(nlp, 0, vehicle.trip.soc_init, vehicle.trip.t_cl_init_degc)
    assert plan.solved
    soc, t_cl, fuel_g = rolled(vehicle, plan, vehicle.trip.soc_init, vehicle.trip.t_cl_init_degc)
    x = plan.x
    # SOC: the mean over a stage against its start in U and R, and the rounded corners
    assert x[-1, NlpVar.SOC] == pytest.approx(soc, abs=2e-3)
    assert x[-1, NlpVar.T_CL] == pytest.approx(t_cl, abs=0.1)
    prices = 5.0 * x[:, NlpVar.T_SLACK].sum()
    assert plan.cost_g - prices == pytest.approx(fuel_g, rel=3e-3)
    assert x[-1, NlpVar.SOC] >= vehicle.trip.soc_init - 1e-6
    assert x[:, NlpVar.ON].min() >= 0.0
    assert x[:, NlpVar.ON].max() <= 1.0 + 1e-6


def test_warm_equals_cold() -> None:
    nlp = planner(beginning("nycc", 300))
    for step, soc, t_cl_degc in ((50, 0.6, 48.0), (150, 0.62, 52.0), (250, 0.59, 45.0)):
        for before in range(step - 2, step):
            plan_of(nlp, before, soc, t_cl_degc)
        cold = nlp.solver.solve(nlp.preview.at(step), soc, t_cl_degc)
        warm = plan_of(nlp, step, soc, t_cl_degc)
        assert warm.solved
        assert cold.solved
        assert warm.cost_g == pytest.approx(cold.cost_g, abs=1e-3)


def assert_drives_by_itself(summary: dict[str, Any], *limits: str) -> None:
    """Plans of IPOPT throughout, and these limits are never exceeded."""
    assert summary["controller"] == "mh-nlp"
    assert summary["solver"]["name"] == "ipopt"
    assert summary["fallback_steps"] == 0
    assert [summary["violations"][name] for name in limits] == [0.0] * len(limits)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "limits"),
    [
        ({"trip.t_cl_init_degc": 89.5}, ("soc", "power_w", "t_cl_degc")),
        ({"trip.t_cl_init_degc": 30.0}, ("soc", "power_w")),  # it starts below the coolant's
        ({"trip.soc_init": 0.42}, ("soc", "power_w", "t_cl_degc")),
        ({"trip.soc_init": 0.79}, ("soc", "power_w", "t_cl_degc")),
    ],
)
def test_closed_loop_from_a_corner(changes: dict[str, object], limits: tuple[str, ...]) -> None:
    """What a corner asks for comes first: a stop, and the way up to 40 km/h."""
    run = simulate(beginning("udds", 70), MhNlp, VEHICLE.with_settings(changes))
    assert_drives_by_itself(run.summary(), *limits)


def test_ladder() -> None:
    nlp = planner(beginning("nycc", 60))
    driver = RecedingHorizon(nlp.trip, nlp)
    solve = nlp.solver.solve
    failed = replace(plan_of(nlp, 0, 0.6, 50.0), solved=False)

    def rung(step: int) -> str:
        return driver.decide(nlp.trip.observation(step, PlantState(0.6, 50.0))).fallback

    assert rung(0) == ""
    nlp.solver.solve = lambda *_, **__: failed  # type: ignore[method-assign]
    last = PLAN_VALID_STEPS + 3
    rungs = [rung(step) for step in range(1, last + 1)]
    assert rungs == ["shifted plan"] * PLAN_VALID_STEPS + ["rule-based"] * 3
    nlp.solver.solve = solve  # type: ignore[method-assign]
    assert rung(last + 1) == ""


def test_its_soc_limits_are_those_of_the_qp() -> None:
    """The swing inside blocks too; where the QP has none, what a battery can hold."""
    of_qp, trip = ControllerSettings().mh_qp, Trip(beginning("udds", 600), VEHICLE)
    stages = trip.preview(of_qp.horizon).at(0)
    count = len(stages.duration_s)
    qp = StageQp(VEHICLE, PwaModel.of(VEHICLE, of_qp.pwa), count, of_qp.qp, of_qp.scaling)
    data = qp.update(stages, 0.6, 52.0, Linearisation.constant(count, 52.0))
    low, high = (
        (bound / data.scaling.row).reshape(count, -1)[:, qp.rows.first("box_soc")]
        for bound in (data.lower, data.upper)
    )
    program = NlpProblem(VEHICLE, count, of_qp.horizon.short_stages, of_qp.qp)
    found = program.data(stages, 0.6, 52.0)
    soc_low = found.row_lower.reshape(count, -1)[:, SOC_ROW] * UNIT[NlpVar.SOC]
    soc_high = found.upper[:-1].reshape(count, -1)[:, NlpVar.SOC] * UNIT[NlpVar.SOC]
    limited = high < 1.0
    assert (high[limited] < VEHICLE.battery.soc_max - 0.01).any()
    # of the reach alone the NLP has the true battery curve, the QP the fitted one
    assert soc_low[limited] == pytest.approx(low[limited], abs=1e-4)
    assert soc_high[limited] == pytest.approx(high[limited], abs=1e-12)
    assert soc_high[~limited] == pytest.approx(1.0)


@pytest.mark.slow
def test_comparison() -> None:
    cycle = beginning("nycc", 200)
    comparison = compare([Trip(cycle, VEHICLE)], every=20)
    result = json.loads(json.dumps(comparison.to_dict()))
    (open_loop,), (closed_loop,) = result["open_loop"], result["closed_loop"]
    assert open_loop["states"] == 10
    assert open_loop["nlp_unsolved"] == 0
    assert open_loop["same_on_off_share"] > 0.9
    # what the PWA curves, the linearised alpha and a limited number of iterations cost together
    assert open_loop["planned_fuel_percent"]["max"] < PLANNED_FUEL_PERCENT
    assert open_loop["soc"]["median"] < 0.01
    assert abs(closed_loop["fuel_difference_percent"]) < FUEL_PERCENT
    assert closed_loop["qp"]["controller"] == "mh-qp"
    assert_drives_by_itself(closed_loop["nlp"], "soc", "power_w", "t_cl_degc")
    assert set(closed_loop["time_ratio"]) == {"median", "p99", "max"}


def test_driving_a_plan_of_the_nonlinear_program_repeats_it() -> None:
    nlp = MhNlp(Trip(beginning("nycc", 200), VEHICLE))
    start = nlp.trip.start
    plan = nlp.solve(start)
    power = [plan.power_on_w(k) for k in range(len(plan.z))]
    sigma = plan.x[:, NlpVar.ON]
    driver = PlanDriver(nlp.solver.problem)
    driven = driver.drive(plan.stages, start, sigma, sigma * power)
    last = np.flatnonzero(plan.stages.duration_s > 0.0)[-1]
    assert driven.soc_end == pytest.approx(plan.x[last, NlpVar.SOC], abs=1e-5)
    assert driven.t_cl_end_degc == pytest.approx(plan.x[last, NlpVar.T_CL], abs=1e-3)
    # the objective has the prices of regularisation and of SOC thrown away besides
    assert driven.fuel_g == pytest.approx(plan.cost_g, rel=1e-3)
    # more SOC at arrival costs fuel: what the costate says, by driving to another target
    least = VEHICLE.with_settings({"trip.soc_end": VEHICLE.trip.soc_target + 0.002})
    other = MhNlp(Trip(beginning("nycc", 200), least)).solve(start)
    gained = other.x[last, NlpVar.SOC] - plan.x[last, NlpVar.SOC]
    assert other.cost_g - plan.cost_g == pytest.approx(plan.soc_costate_g * gained, rel=0.05)


def test_comparison_notices_a_coarse_model() -> None:
    trip = Trip(beginning("nycc", 60), VEHICLE)
    coarse = ControllerSettings().with_settings({"mh_qp.pwa.fuel_g_per_s": 0.2})
    fine_plan, coarse_plan = (
        compare_open_loop(trip, every=60, settings=chosen).pairs[0] for chosen in (None, coarse)
    )
    assert coarse_plan.nlp_fuel_g == pytest.approx(fine_plan.nlp_fuel_g, rel=1e-6)
    fine, rough = (abs(p.qp_fuel_g - p.nlp_fuel_g) for p in (fine_plan, coarse_plan))
    assert rough > 2.0 * fine


def test_missing_casadi_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(QpmpcError, match=r"pip install 'qpmpc-iptm\[verification\]'") as error:
        SmoothMaps(VEHICLE).alpha(50.0)
    assert "\n" not in str(error.value)


def test_starts_are_what_the_on_share_rises_and_are_paid_for() -> None:
    cycle = beginning("nycc", 150)
    starting = VEHICLE.with_settings({"engine.start_fuel_g": 0.2, "engine.start_energy_j": 4000.0})
    nlp, free = planner(cycle, starting), planner(cycle)
    for engine_on in (False, True):
        seen = nlp.trip.observation(20, PlantState(0.6, 52.0, engine_on))
        plan = nlp.solve(seen)
        assert plan.solved
        sigma, starts = plan.x[:, NlpVar.ON], plan.x[:, NlpVar.START]
        before = np.concatenate([[float(engine_on)], sigma[:-1]])
        expected = np.maximum(plan.stages.rises * (sigma - before), 0.0)
        assert starts == pytest.approx(expected, abs=2e-3)
        # what starts take: their fuel, and energy that has to be made with more
        assert plan.cost_g > free.solve(seen).cost_g + 0.2 * starts.sum()
