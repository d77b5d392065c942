"""Terms of users in the cvxpy program: what they change in closed loop, and what they are told."""

import runpy
from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

import qpmpc
from qpmpc import CvxpyPlanner, Cycle, InputError, QpmpcError, Trip, load_cycle, load_vehicle
from qpmpc.results import LOOSE_GAP

EXAMPLES = Path(__file__).parents[2] / "examples"
# mh-qp is within 0.2 % of the optimum on this cycle, so no term can save more than about that
OPTIMAL_SHARE = 0.997


def driven(name: str) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Figures of mh-qp and of the example's planner on NYCC, and the example itself."""
    example = runpy.run_path(str(EXAMPLES / name))
    usual, changed = example["runs"].rows()
    assert usual["controller"] == "mh-qp"
    assert changed["comparable"]
    assert changed["fallback_steps"] == 0
    assert not any(changed["violations"].values())
    assert changed["fuel_soc_balanced_g"] >= OPTIMAL_SHARE * usual["fuel_soc_balanced_g"]
    return usual, changed, example


@pytest.mark.slow
def test_a_limit_on_starts_leaves_fewer_of_them() -> None:
    usual, changed, example = driven("engine_starts.py")
    # a start above the limit is priced at 25 times its fuel: longer runs are cheaper
    assert changed["engine_starts"] < usual["engine_starts"]
    most = "most_starts_in_200_s"
    assert changed["figures"][most] < usual["figures"][most]
    # shares of a start in the plan, and seconds that need the engine, may exceed it by one
    assert changed["figures"][most] <= example["MOST"] + 1


@pytest.mark.slow
def test_a_price_on_nox_leaves_less_of_it() -> None:
    usual, changed, _ = driven("nox.py")
    # its curve is convex: the same energy at less power, for longer, has less; the price is worth
    # 9 g of fuel, a sixth of all, for what mh-qp emits
    assert changed["figures"]["nox_mg"] < 0.9 * usual["figures"]["nox_mg"]


@pytest.mark.slow
def test_a_limit_on_its_temperature_leaves_the_battery_cooler() -> None:
    usual, changed, example = driven("battery_temperature.py")
    # heat is R I2: the engine takes a part of the peaks; braking energy is taken all the same
    warmed = [row["figures"]["hottest_degC"] - example["CABIN_DEGC"] for row in (usual, changed)]
    assert warmed[1] < 0.9 * warmed[0]


def short(seconds: int = 12) -> Trip:
    cycle = load_cycle("nycc")
    part = [values[30 : 31 + seconds] for values in (cycle.time_s, cycle.speed_mps, cycle.grade)]
    return Trip(Cycle("part", part[0] - part[0][0], *part[1:]), load_vehicle("prius-nimh"))


def planner(terms: Any) -> type[CvxpyPlanner]:
    return type("Mine", (CvxpyPlanner,), {"name": "mine", "terms": terms})


P, WEIGHT = cp.Parameter(name="mine", nonneg=True), cp.Parameter(name="weight")
WRONG = {
    "not convex": (lambda s, p: (-cp.sum_squares(p.on), []), "cost is not convex .* concave"),
    "per stage": (lambda s, p: (p.on, []), r"shape \(62,\), and must be one number .* cp.sum"),
    "no pair": (lambda s, p: [], "not \\(cost, \\[constraints\\]\\)"),
    "no list": (lambda s, p: (0.0, p.soc >= 0.5), "not a list"),
    "no constraint": (lambda s, p: (0.0, [p.soc >= 0.5, True]), "constraint 2 is True"),
    "concave limit": (lambda s, p: (0.0, [cp.sqrt(p.on) <= 0.5]), "constraint 1 is not convex"),
    "shape": (lambda s, p: (cp.sum(p.on + np.ones(20)), []), r"shape \(62,\), one entry per stage"),
    "name": (lambda s, p: (cp.sum(p.p_engine_w), []), "did you mean 'p_eng_w'"),
    "not DPP": (lambda s, p: (P * cp.sum(p.given("duration_s")) + P * P, []), "DPP"),
    "sign": (lambda s, p: (WEIGHT * cp.square(p.soc[-1]), []), "if weight weighs .*nonneg=True"),
    "net_w": (
        lambda s, p: (cp.sum(cp.multiply(p.given("net_w"), cp.square(p.on))), []),
        "net_w may be negative",
    ),
    "text": (lambda s, p: ("much", []), "the cost is much, not an"),
}


@pytest.mark.parametrize("which", WRONG)
def test_a_wrong_term_is_named_before_the_trip(which: str) -> None:
    terms, said = WRONG[which]
    with pytest.raises(QpmpcError, match=f"^mine: terms.*{said}"):
        planner(terms)(short())


def test_a_quantity_has_its_own_message() -> None:
    with pytest.raises(InputError, match="did you mean 'duration_s'"):
        planner(lambda s, p: (cp.sum(p.given("durations")), []))(short())


def test_a_parameter_without_value_is_named() -> None:
    mine = planner(lambda s, p: (cp.Parameter(name="left", nonneg=True) * cp.sum(p.on), []))
    with pytest.raises(QpmpcError, match=r"parameter 'left' .* set it in plan"):
        qpmpc.simulate(short(), mine)


def test_constraints_that_leave_no_plan_are_found_guilty() -> None:
    run = qpmpc.simulate(short(), planner(lambda s, p: (0.0, [p.soc >= 0.9])))
    (said,) = [line for line in run.remarks if "no plan" in line]
    assert said.endswith("without the constraints of terms there is a plan")
    assert not run.comparable  # the rules drove


def test_a_car_whose_starts_are_free_has_none_in_its_program() -> None:
    cycle = short().cycle
    with pytest.raises(QpmpcError, match="unknown name of the program 'starts'"):
        planner(lambda s, p: (cp.sum(p.starts), []))(Trip(cycle, load_vehicle("paper-nimh")))


def test_a_state_is_what_its_equation_makes_of_it() -> None:
    """A state that integrates the plan's power is the sum of its energy, from its value now."""

    def terms(self: Any, program: Any) -> Any:
        self.energy = program.state("energy_kj")
        of_stage = cp.multiply(program.given("duration_s"), program.p_eng_w / 1e3)
        return 0.0, [self.energy.end == self.energy.before + of_stage]

    trip = short()
    mine = planner(terms)(trip)
    mine.energy.now.value = 7.0
    assert mine.plan(trip.start).usable
    duration_s, power_w = mine.program.given("duration_s").value, mine.program.p_eng_w.value
    expected = 7.0 + np.cumsum(duration_s * power_w / 1e3)
    assert mine.energy.end.value == pytest.approx(expected, abs=1e-4)  # Clarabel's feasibility


def test_own_figures_are_in_table_json_and_report(tmp_path: Path) -> None:
    trip = short()
    figures = {"peak_kW": lambda run: run.trajectory.p_eng_w.max() / 1e3}
    runs = qpmpc.compare(trip, ["rule-based"], figures=figures)
    assert runs.rows()[0]["figures"]["peak_kW"] == runs[0].trajectory.p_eng_w.max() / 1e3
    assert "peak kW" in str(runs)
    assert "peak kW" in runs.to_html(tmp_path / "report.html").read_text("utf-8")


def test_a_term_may_be_weighed_by_durations() -> None:
    """They are not negative, and cvxpy knows it: a square weighed by them is convex."""

    def terms(self: Any, program: Any) -> Any:
        ends_kw2 = cp.square(program.internal_w / 1e3)
        return 5e-4 * cp.sum(cp.multiply(program.given("duration_s"), ends_kw2)), []

    trip = short()
    assert planner(terms)(trip).plan(trip.start).usable


def test_a_plan_that_cannot_be_driven_is_found_out() -> None:
    """A price on charging, of three times what a charge is worth: losses spare it."""

    def terms(self: Any, program: Any) -> Any:
        charging_kw = cp.pos(-program.internal_w / 1e3)
        return 0.2 * cp.sum(cp.multiply(program.given("duration_s"), charging_kw)), []

    sound, loose = (qpmpc.simulate(short(60), each) for each in (CvxpyPlanner, planner(terms)))
    gaps = [run.summary()["relaxation_gap"]["mean"] for run in (sound, loose)]
    assert gaps[0] < LOOSE_GAP < gaps[1]
    assert "off the curves of fuel and losses" in loose.doubt
    assert "off the curves" not in sound.doubt
    assert sound.fuel_expected_g is not None


class Failing(CvxpyPlanner):
    """Finds no solution in some of its solves, counted from 1."""

    name = "failing"
    fails: tuple[int, ...] = ()
    solves = 0

    def solved(self) -> Any:
        self.solves += 1
        if self.solves in self.fails:
            raise QpmpcError("no solution")
        return super().solved()


def test_a_failure_at_departure_costs_what_was_expected_and_no_plan() -> None:
    """The first plan drives where the second linearisation of departure has no solution."""
    trip = short()
    mine = Failing(trip)
    mine.fails = (2,)
    mine.depart(trip.start)
    assert mine.plan(trip.start).usable
    assert mine.expects is None
    assert mine.plan(trip.start._replace(step=1)).usable
    assert mine.solves == 3  # it departs once


def test_a_first_second_without_a_solution_is_not_made_up_for_later() -> None:
    trip = short()
    mine = Failing(trip)
    mine.fails = (1,)
    mine.depart(trip.start)
    assert not mine.plan(trip.start).usable
    assert mine.plan(trip.start._replace(step=1)).usable
    assert mine.solves == 2
    assert mine.expects is None
    mine.fails = ()
    mine.depart(trip.start)
    assert mine.plan(trip.start).usable
    assert mine.expects is not None
