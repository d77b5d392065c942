"""Dynamic programming against closed forms, exhaustive search, other drivers, and itself."""

import subprocess
import sys
from dataclasses import replace
from functools import cache as cache_calls
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.vehicle import Command, Plant, PlantState, Vehicle, demand_w, load_vehicle
from qpmpc.verification.dynamic_programming import (
    DpSettings,
    DpSolution,
    cache,
    convergence_study,
    solve_dp,
)
from qpmpc.verification.dynamic_programming.kernels import alpha, hot_fuel_g, losses_w
from qpmpc.verification.dynamic_programming.kernels import next_soc as compiled_next_soc
from qpmpc.verification.dynamic_programming.kernels import next_t_cl as compiled_next_t_cl
from qpmpc.verification.dynamic_programming.problem import build_problem

# The engine of the paper: closed forms, searches and rules know of no start, run or ramp.
# `test_dp_engine_limits` has those.
VEHICLE = load_vehicle("paper-nimh")
PLANT = Plant(VEHICLE)
NYCC = build_problem(load_cycle("nycc"), VEHICLE)
MAPS, CONSTANTS = NYCC.maps, NYCC.constants
COARSE = DpSettings(soc_step=0.004, t_cl_step_k=1.0, power_step_w=1000.0, refinement=2, threads=1)
QUICK = DpSettings.quick().model_copy(update={"threads": 1})
# for a drive of seconds, where a cell is a large part of the energy
FINE = DpSettings(power_step_w=250.0, refinement=16, tube_soc=0.02, tube_t_cl_k=1.0, threads=1)
ROUNDING = 1e-9


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))


def steady(speed_mps: float, steps: int) -> Cycle:
    return Cycle.from_samples("steady", np.arange(steps + 1), np.full(steps + 1, speed_mps))


def urban(steps: int = 180) -> Cycle:
    """The first minutes of UDDS: stops, 90 km/h, braking."""
    whole = load_cycle("udds")
    return Cycle.from_samples("urban", whole.time_s[: steps + 1], whole.speed_mps[: steps + 1])


def with_settings(**values: object) -> Vehicle:
    return VEHICLE.with_settings({key.replace("__", "."): value for key, value in values.items()})


plant_of = cache_calls(Plant)


def replay(
    cycle: Cycle, vehicle: Vehicle, engine_on: list[bool], p_eng_w: list[float]
) -> tuple[list[PlantState], float, float]:
    """States, fuel and greatest power excess of commands on a fresh plant."""
    plant = plant_of(vehicle)
    states, fuel, excess = [plant.initial_state()], 0.0, 0.0
    demand = demand_w(cycle, vehicle)
    for k, (on, power) in enumerate(zip(engine_on, p_eng_w, strict=True)):
        following, flows = plant.step(
            states[-1], Command(on, power), float(demand[k]), float(cycle.step_speed_mps[k])
        )
        states.append(following)
        fuel += flows.fuel_g
        excess = max(excess, flows.power_excess_w)
    return states, fuel, excess


def check_admissible(solution: DpSolution, cycle: Cycle, vehicle: Vehicle) -> None:
    """The commands, replayed, give these states, and keep every limit."""
    states, fuel, excess = replay(
        cycle, vehicle, solution.engine_on.tolist(), solution.p_eng_w.tolist()
    )
    assert solution.admissible
    assert [s.soc for s in states] == solution.soc.tolist()
    assert [s.t_cl_degc for s in states] == solution.t_cl_degc.tolist()
    assert fuel == pytest.approx(solution.fuel_total_g, rel=1e-12)
    assert excess == 0.0
    battery, thermal = vehicle.battery, vehicle.thermal
    assert solution.soc.min() >= battery.soc_min
    assert solution.soc.max() <= battery.soc_max + ROUNDING
    assert solution.soc[-1] >= vehicle.trip.soc_init - ROUNDING
    assert solution.t_cl_degc.min() >= thermal.t_cl_min_degc
    assert solution.t_cl_degc.max() <= thermal.t_cl_max_degc


# the model inside is the plant


@settings(deadline=None)  # the first call compiles
@given(
    soc=st.floats(0.4, 0.8),
    t_cl=st.floats(40.0, 90.0),
    demand=st.floats(-60e3, 60e3),
    speed=st.floats(0.0, 40.0),
    share=st.none() | st.floats(0.0, 1.0),
)
def test_compiled_step_is_the_plants(
    soc: float, t_cl: float, demand: float, speed: float, share: float | None
) -> None:
    # engine power within the limits of problem.build_problem, where both are defined
    low = max(0.0, demand + 400.0 - 27e3)
    high = min(71e3, max(demand, 0.0) + 400.0 + 25e3)
    assume(share is not None or demand + 400.0 <= 27e3)  # else it must run
    power = 0.0 if share is None else low + share * (high - low)
    state, flows = PLANT.step(
        PlantState(soc, t_cl), Command(share is not None, power), demand, speed
    )
    fuel = 0.0 if share is None else alpha(CONSTANTS, t_cl) * hot_fuel_g(MAPS, power)
    t_end = compiled_next_t_cl(CONSTANTS, t_cl, fuel, power, losses_w(CONSTANTS, t_cl, speed))
    assert fuel == pytest.approx(flows.fuel_g, rel=1e-12)
    assert t_end == pytest.approx(state.t_cl_degc, rel=1e-12)
    assert compiled_next_soc(MAPS, CONSTANTS, soc, demand, power) == pytest.approx(
        state.soc, abs=1e-13
    )


# optimality


def test_lossless_battery_has_a_closed_form() -> None:
    """With U constant, R = 10 uOhm and alpha = 1 only the energy E = sum(P_d + P_aux) counts.

    Every way to make it burns at least E min_P f(P)/P, and m equal seconds burn m f(E/m).
    """
    grid = list(VEHICLE.battery.soc_grid)
    vehicle = with_settings(
        cold_engine__k=0.0,
        battery__open_circuit_v=[200.0] * len(grid),
        battery__resistance_discharge_ohm=[1e-5] * len(grid),
        battery__resistance_charge_ohm=[1e-5] * len(grid),
    )
    cycle = steady(20.0, 40)
    solution = solve_dp(cycle, vehicle, COARSE)
    power_w = demand_w(cycle, vehicle)[0] + vehicle.battery.aux_power_w
    energy_j = 40 * power_w
    most_w = power_w + vehicle.battery.power_charge_max_w
    line = plant_of(vehicle).line
    power = np.linspace(1.0, most_w, 20_000)
    least = energy_j * float(np.min(line.fuel(power) / power))
    equal = min(m * line.fuel.at(energy_j / m) for m in range(1, 41) if energy_j / m <= most_w)
    assert least <= solution.fuel_total_g <= equal * (1.0 + 1e-4)
    # the two bounds are close enough to say something
    assert equal <= 1.02 * least


@pytest.mark.parametrize("settings_", [{}, {"engine.start_fuel_g": 0.2}])
def test_exhaustive_search_finds_nothing_better(settings_: dict[str, object]) -> None:
    """All on/off sequences of a few seconds, each with its powers optimised on the plant."""
    vehicle = VEHICLE.with_settings(settings_)
    speed = np.array([12.0, 13.0, 14.5, 15.0, 14.0, 11.0])
    cycle = Cycle.from_samples("burst", np.arange(6), speed)
    demand = demand_w(cycle, vehicle)
    best = np.inf
    for pattern in product((False, True), repeat=5):
        on = np.flatnonzero(pattern)
        if len(on) == 0:
            continue

        def run(
            power_kw: np.ndarray, pattern: tuple[bool, ...] = pattern, on: np.ndarray = on
        ) -> tuple[list[PlantState], float, float]:
            power = np.zeros(5)
            power[on] = 1e3 * power_kw
            return replay(cycle, vehicle, list(pattern), power.tolist())

        high = (np.maximum(demand, 0.0)[on] + 400.0 + 25e3) * 1e-3
        result = minimize(
            lambda p: run(p)[1],
            np.full(len(on), float(demand.sum() + 2000.0) * 1e-3 / len(on)).clip(max=high),
            method="SLSQP",
            bounds=[(0.0, h) for h in high],
            constraints={
                "type": "ineq",
                "fun": lambda p: 1e4 * (run(p)[0][-1].soc - vehicle.trip.soc_init),
            },
            options={"ftol": 1e-9},
        )
        states, fuel, _ = run(result.x)
        if states[-1].soc >= vehicle.trip.soc_init - 1e-7:
            best = min(best, fuel)
    solution = solve_dp(cycle, vehicle, FINE)
    check_admissible(solution, cycle, vehicle)
    # SLSQP may end 1e-7 in SOC short, worth 3e-5 g, and stop at a kink of the fuel line
    assert solution.fuel_total_g == pytest.approx(best, rel=3e-4)


@pytest.fixture(scope="module")
def urban_solution() -> DpSolution:
    return solve_dp(urban(), VEHICLE, QUICK, use_cache=False)


@pytest.mark.parametrize("threshold_w", [0.0, 2e3, 4e3, 6e3, 8e3, 12e3])
@pytest.mark.parametrize("follow", [0.0, 0.5, 1.0])
def test_no_rule_beats_it(urban_solution: DpSolution, threshold_w: float, follow: float) -> None:
    """Engine on above a demand, at a base power plus a share of the demand.

    The base is set so that the trip ends at the SOC it began with.
    """
    cycle = urban()
    demand = demand_w(cycle, VEHICLE)
    on = demand > threshold_w

    def drive(base_w: float) -> tuple[float, float]:
        power = np.clip(base_w + follow * demand, 0.0, np.maximum(demand, 0.0) + 25.4e3) * on
        states, fuel, _ = replay(cycle, VEHICLE, on.tolist(), power.tolist())
        return states[-1].soc, fuel

    low, high = 0.0, 60e3
    assert drive(high)[0] > VEHICLE.trip.soc_init
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if drive(middle)[0] >= VEHICLE.trip.soc_init else (middle, high)
    assert urban_solution.fuel_total_g < drive(high)[1]


def test_doubling_the_grid_hardly_moves_fuel() -> None:
    first, second, third = convergence_study(urban(), VEHICLE, COARSE, doublings=2)
    for coarse, fine in ((first, second), (second, third)):
        assert fine.levels[-1].soc_step == pytest.approx(coarse.levels[-1].soc_step / 2)
        assert fine.levels[-1].t_cl_step_k == pytest.approx(coarse.levels[-1].t_cl_step_k / 2)
        assert fine.fuel_total_g == pytest.approx(coarse.fuel_total_g, rel=1e-3)
        assert abs(fine.gap_g) < abs(coarse.gap_g)
    assert abs(third.gap_g) < 1e-3 * third.fuel_total_g
    assert third.converged


def test_grid_power_and_tube_agree_with_the_whole_box() -> None:
    whole = DpSettings(
        soc_step=0.002, t_cl_step_k=0.5, power_step_w=1000.0, refinement=1, threads=1
    )
    tube = COARSE
    cycle = urban(120)
    assert solve_dp(cycle, VEHICLE, tube).fuel_total_g == pytest.approx(
        solve_dp(cycle, VEHICLE, whole).fuel_total_g, rel=1e-3
    )


# physics


def test_colder_days_cost_more() -> None:
    fuel = [
        solve_dp(urban(), with_settings(thermal__t_amb_degc=t), COARSE).fuel_total_g
        for t in (10.0, -7.0, -15.0)
    ]
    assert fuel[0] < fuel[1] < fuel[2]


def test_start_cost_buys_fewer_starts(urban_solution: DpSolution) -> None:
    vehicle = with_settings(engine__start_fuel_g=0.5)
    costly = solve_dp(urban(), vehicle, COARSE)
    check_admissible(costly, urban(), vehicle)

    def starts(solution: DpSolution) -> int:
        return int(np.sum(np.diff(solution.engine_on.astype(int), prepend=0) == 1))

    assert starts(costly) < starts(urban_solution)
    assert costly.fuel_total_g > urban_solution.fuel_total_g
    # driving as before, and paying for the starts, is one of its choices
    paying = urban_solution.fuel_total_g + 0.5 * starts(urban_solution)
    assert costly.fuel_total_g <= paying


@pytest.mark.parametrize(
    "limits",
    [
        {},
        # coolant that falls to its floor, battery that hits both ends
        {"trip.t_cl_init_degc": 40.3, "thermal.t_amb_degc": -20.0},
        {"battery.soc_min": 0.595, "battery.soc_max": 0.603},
        {"trip.t_cl_init_degc": 88.0, "thermal.t_cl_max_degc": 88.0, "thermal.t_amb_degc": 10.0},
        {"battery.power_discharge_max_w": 9e3, "battery.power_charge_max_w": 6e3},
        {"engine.power_min_w": 6e3},
        {"trip.soc_init": 0.4},
        {"trip.soc_init": 0.8},
    ],
    ids=lambda limits: ",".join(limits) or "default",
)
def test_limits_are_kept(limits: dict[str, object]) -> None:
    vehicle = VEHICLE.with_settings(limits)
    check_admissible(solve_dp(urban(), vehicle, COARSE), urban(), vehicle)


def test_tight_limits_cost_fuel(urban_solution: DpSolution) -> None:
    tight = with_settings(battery__soc_min=0.595, battery__soc_max=0.603)
    assert solve_dp(urban(), tight, COARSE).fuel_total_g > urban_solution.fuel_total_g


def test_coasting_cycle_needs_no_fuel() -> None:
    cycle = Cycle.from_samples("stop", np.arange(11), np.linspace(20.0, 0.0, 11))
    solution = solve_dp(cycle, VEHICLE, COARSE)
    assert solution.fuel_total_g == 0.0
    assert solution.value_g == 0.0
    assert not solution.engine_on.any()


def test_demand_beyond_the_car_is_reported() -> None:
    climb = Cycle.from_samples("climb", np.arange(6), np.full(6, 40.0), np.full(6, 0.3))
    assert not solve_dp(climb, VEHICLE, COARSE).admissible


# costates


def test_costates_are_slopes_of_fuel(urban_solution: DpSolution) -> None:
    """lambda_T(0) is the central difference of optimal fuel over the initial temperature."""
    below, above = (
        solve_dp(urban(), with_settings(trip__t_cl_init_degc=50.0 + d), QUICK).fuel_total_g
        for d in (-2.0, 2.0)
    )
    slope = (below - above) / 4.0
    assert urban_solution.t_cl_costate_g_per_k[0] == pytest.approx(slope, rel=0.02)


def test_costates_have_signs_and_sizes_of_prices(urban_solution: DpSolution) -> None:
    solution = urban_solution
    running = slice(0, int(np.flatnonzero(solution.engine_on)[-1]))
    # charge is worth fuel, at an efficiency between a poor and the best of engines (0.40)
    assert np.all(solution.soc_costate_g[running] > 0.0)
    assert np.all(solution.soc_efficiency[running] > 0.25)
    assert np.all(solution.soc_efficiency[running] < 0.42)
    # heat saves fuel (alpha falls with T); none of it once the engine has stopped for good
    assert np.all(solution.t_cl_costate_g_per_k[running] > 0.0)
    assert solution.t_cl_costate_g_per_k[-1] == 0.0
    capacity = VEHICLE.thermal.heat_capacity_j_per_k
    np.testing.assert_allclose(
        solution.heat_costate_g_per_mj * capacity, 1e6 * solution.t_cl_costate_g_per_k
    )


# cache, progress, errors


def same(a: DpSolution, b: DpSolution) -> bool:
    return all(
        np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y
        for x, y in zip(vars(a).values(), vars(b).values(), strict=True)
    )


def test_cached_result_is_identical() -> None:
    cycle = steady(15.0, 20)
    first = solve_dp(cycle, VEHICLE, COARSE)
    (file,) = cache.folder().iterdir()
    number = file.stat().st_ino
    again = solve_dp(cycle, VEHICLE, COARSE)
    assert same(first, again)
    assert file.stat().st_ino == number  # not written again
    assert same(first, solve_dp(cycle, VEHICLE, COARSE, use_cache=False))
    # a spoilt file is replaced
    file.write_bytes(file.read_bytes()[:100])
    assert same(first, solve_dp(cycle, VEHICLE, COARSE))
    assert [path.name for path in cache.folder().iterdir()] == [file.name]
    assert cache.load(cache.key(cycle, VEHICLE, COARSE)) is not None


def test_cache_distinguishes_what_matters() -> None:
    cycle = steady(15.0, 20)
    key = cache.key(cycle, VEHICLE, COARSE)
    assert key != cache.key(steady(15.0, 21), VEHICLE, COARSE)
    assert key != cache.key(replace(cycle, grade=np.full(21, 0.01)), VEHICLE, COARSE)
    assert key != cache.key(cycle, with_settings(trip__soc_init=0.61), COARSE)
    assert key != cache.key(cycle, VEHICLE, COARSE.doubled())
    assert key == cache.key(cycle, VEHICLE, COARSE.model_copy(update={"threads": 2}))


def test_cache_folder_that_cannot_be_written_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert solve_dp(steady(15.0, 5), VEHICLE, COARSE).admissible


def test_threads_do_not_change_the_result() -> None:
    fine = COARSE.model_copy(update={"t_cl_step_k": 0.4})  # large enough to be shared out
    one, two = (
        solve_dp(urban(20), VEHICLE, fine.model_copy(update={"threads": n}), use_cache=False)
        for n in (1, 2)
    )
    assert same(one, two)


def test_progress_grows_to_one() -> None:
    seen: list[float] = []
    convergence_study(steady(15.0, 20), VEHICLE, COARSE, doublings=1, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0)
    assert len(seen) > 10


def test_start_outside_the_coolant_limits_is_refused() -> None:
    with pytest.raises(InputError, match=r"t_cl_init_degc.*40 \.\. 90 \(given: 20\)"):
        solve_dp(urban(), with_settings(trip__t_cl_init_degc=20.0), COARSE)


def test_without_numba_one_line_says_what_to_install() -> None:
    program = (
        "import sys; sys.modules['numba'] = None\n"
        "import qpmpc.verification.dynamic_programming as dp\n"
        "from qpmpc.cycles import load_cycle\n"
        "from qpmpc.errors import QpmpcError\n"
        "from qpmpc.vehicle import load_vehicle\n"
        "try: dp.solve_dp(load_cycle('nycc'), load_vehicle(), use_cache=False)\n"
        "except QpmpcError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == [
        "dynamic programming needs numba: install it with pip install 'qpmpc-iptm[verification]'"
    ]


def test_price_of_final_soc_is_the_slope_of_the_optimum():
    nycc = load_cycle("nycc")
    ends = 0.59, 0.61
    less, more = (
        solve_dp(nycc, with_settings(trip__soc_end=end), QUICK).fuel_total_g for end in ends
    )
    price = solve_dp(nycc, VEHICLE, QUICK).soc_price_g(VEHICLE.battery)
    # 1 %: fuel of the quick grid is exact to 0.02 g of some 6.3
    assert price == pytest.approx((more - less) / (ends[1] - ends[0]), rel=0.01)


def test_a_trip_that_ends_downhill_prices_charge_at_nothing():
    flat = load_cycle("nycc")
    grade = np.where(flat.time_s > 200.0, -0.08, 0.0)
    hill = Cycle.from_samples("hill", flat.time_s, flat.speed_mps, grade)
    solution = solve_dp(hill, VEHICLE, QUICK)
    assert solution.soc[-1] > 0.61  # it arrives with more than asked for
    assert solution.soc_price_g(VEHICLE.battery) == 0.0
    lost = replace(solution, admissible=False)
    assert lost.soc_price_g(VEHICLE.battery) is None
