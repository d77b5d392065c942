"""Two FMUs in a loop are `qpmpc simulate`; instances do not know of each other."""

import re
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmus import CONTROLLERS, SHOWN, TO_CONTROLLER, TO_PLANT, Loop, Unit, connect

from qpmpc import simulate

# mh-costate's search counts a step from a rise of 1e-7 g on; where it rises by just that, rounding
# decides, which moves the power by up to 1 W of 10 kW: see docs/embedded.md
WITHIN = {"2": 1e-8, "3": 1e-5}


@pytest.mark.parametrize("what", ["controller2", "plant2", "controller3", "plant3"])
def test_it_is_valid(fmus, what):
    assert validate_fmu(str(fmus[what])) == []


@pytest.mark.parametrize("asks", [False, True], ids=["stepped in order", "asked, then stepped"])
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_two_fmus_are_simulate(fmus, trip, fmi, asks):
    """To rounding, of previews' sums made in another order and the plant's, and what it decides."""
    run = simulate(trip, CONTROLLERS[fmi]).trajectory
    with Unit(fmus[f"controller{fmi}"]) as controller, Unit(fmus[f"plant{fmi}"]) as plant:
        loop = Loop(controller, plant, asks)
        found, outside = np.empty((trip.steps, len(SHOWN) + 3)), set()
        for t in range(trip.steps):
            found[t] = loop.second(t)
            outside |= {*controller.outside(), *plant.outside()}
        assert outside == set()
        assert controller.get("time") == [trip.steps]
        assert plant.get("fuel_total_g")[0] == pytest.approx(run.fuel_g.sum(), rel=1e-9)
        assert plant.get("demand_w", "speed_mps") == [0.0, 0.0]
        assert controller.logged == plant.logged == []
    assert run.fuel_g.sum() > 50.0
    expected = np.column_stack(
        [run.soc[1:], run.t_cl_degc[1:], run.fuel_g, run.p_eng_w, run.p_bat_w, run.p_eng_w]
    )
    unit = np.array([1.0, 100.0, 1.0, 1e4, 1e4, 1e4])  # what 1e-5 is meant of
    assert np.abs((found[:, :6] - expected) / unit).max() < WITHIN[fmi]
    assert not found[:, 6:].any()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_command_a_second_late_costs_what_is_documented(fmus, trip, fmi):
    """As of a master that reads all outputs first; to 5 %, for other processors."""
    page = (Path(__file__).parents[2] / "docs" / "fmu.md").read_text("utf-8")
    row = rf"\| `{CONTROLLERS[fmi]}`, NYCC \| ([\d.]+) .*?\| (\d+) \| ([\d.]+) .*?\| (\d+) \|"
    in_order_g, _, late_g, late_starts = map(float, re.search(row, page).groups())
    with Unit(fmus[f"controller{fmi}"]) as controller, Unit(fmus[f"plant{fmi}"]) as plant:
        Loop(controller, plant)
        on = [0.0]
        for t in range(trip.steps):
            measured = dict(zip(TO_CONTROLLER, plant.get(*TO_CONTROLLER), strict=True))
            connect(controller, plant, TO_PLANT)
            controller.set(**measured)
            controller.step(t)
            plant.step(t)
            on += plant.get("engine_on")
        (found_g,) = plant.get("fuel_total_g")
    assert found_g == pytest.approx(late_g, rel=0.05)
    assert np.sum(np.diff(np.array(on, float)) > 0.0) == pytest.approx(late_starts, rel=0.1)
    run = simulate(trip, CONTROLLERS[fmi]).trajectory
    assert run.fuel_g.sum() == pytest.approx(in_order_g, rel=0.003)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_instances_side_by_side_are_as_alone(fmus, fmi):
    """Bit by bit, and the two trips differ."""
    controller, plant = fmus[f"controller{fmi}"], fmus[f"plant{fmi}"]
    initial = ({"soc_init": 0.6}, {"soc_init": 0.52, "t_cl_init_degc": 30.0})
    seconds = range(120)
    alone = []
    for values in initial:
        with Unit(controller) as c, Unit(plant) as p:
            loop = Loop(c, p, **values)
            alone.append(loop.drive(seconds))
    assert alone[0] != alone[1]
    with Unit(controller) as c, Unit(plant) as p:
        units = (c.beside(), p.beside())
        with units[0], units[1]:
            loops = [Loop(c, p, **initial[0]), Loop(*units, **initial[1])]
            together = list(
                zip(*([loop.second(t) for loop in loops] for t in seconds), strict=True)
            )
    assert [list(each) for each in together] == alone


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_reset_is_as_new(fmus, fmi):
    with Unit(fmus[f"controller{fmi}"]) as c, Unit(fmus[f"plant{fmi}"]) as p:
        loop = Loop(c, p, soc_init=0.5)
        first = loop.drive(range(30))
        loop.reset()
        assert p.get("soc", "time") == [0.6, 0.0]
        loop = Loop(c, p, soc_init=0.5)
        again = loop.drive(range(30))
    assert first == again


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_saved_state_brings_all_back(fmus, fmi):
    with Unit(fmus[f"controller{fmi}"]) as c, Unit(fmus[f"plant{fmi}"]) as p:
        loop = Loop(c, p)
        loop.drive(range(100))
        saved = [unit.state() for unit in (c, p)]
        first = loop.drive(range(100, 140))
        for unit, state in zip((c, p), saved, strict=True):
            unit.restore(state)
        assert loop.drive(range(100, 140)) == first


def test_a_question_asked_twice_in_a_second_is_one_decision(fmus):
    """Outputs follow the inputs as often as these change; the last counts."""
    with Unit(fmus["controller2"]) as c, Unit(fmus["plant2"]) as p:
        loop = Loop(c, p, asks=True)
        once = loop.drive(range(40))
    with Unit(fmus["controller2"]) as c, Unit(fmus["plant2"]) as p:
        loop = Loop(c, p, asks=True)
        twice = []
        for t in range(40):
            c.set(soc=0.45, demand_w=20e3)
            c.get("p_eng_command_w")
            twice.append(loop.second(t))
    assert once == twice


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_controller_without_a_measurement_warns_and_says_what_drives(fmus, fmi):
    with Unit(fmus[f"controller{fmi}"]) as unit:
        unit.start(soc=float("nan"))
        assert unit.logged == [
            "no plan before the trip, because of an input out of range at the start: the rules "
            "drive first"
        ]
        unit.step(0)
        (flags,) = unit.get("flags")
        assert flags & 1  # a bad measurement
        unit.set(soc=0.6)
        unit.step(1)
        assert not unit.get("flags")[0] & 1
