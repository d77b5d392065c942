"""The calibration as tunable parameters: listed, at work, refused as the page refuses it."""

import pytest
from fmpy.fmi1 import FMICallException
from fmus import CONTROLLERS, Loop, Unit

from qpmpc import simulate
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.costate_controller import GeneratedCostate

GENERATED = {"2": GeneratedController, "3": GeneratedCostate}
WITHIN_G = {"2": 1e-9, "3": 1e-5}  # see test_closed_loop.py
# Not a higher coolant floor: there mh-costate's search meets ties that rounding decides, and
# 1e-13 of SOC moves the fuel by up to 0.5 g; here by 3e-11 (docs/embedded.md)
FULLER = {"terminal_soc_low": 0.62, "terminal_soc_high": 0.63}
DISCARD = 2
FLAGS = -2  # their place in what a loop shows of a second
CONTRADICTION = (
    "the calibration is refused, the last good one is in use: soc_min is too high for another "
    "number"
)


@pytest.fixture(params=["2", "3"])
def fmi(request):
    return request.param


@pytest.fixture
def units(fmus, fmi):
    with Unit(fmus[f"controller{fmi}"]) as controller, Unit(fmus[f"plant{fmi}"]) as plant:
        yield controller, plant


def flags(driven):
    return {second[FLAGS] for second in driven}


def as_it_is(units, seconds):
    """What is driven with the page as it is, and a loop that begins anew."""
    loop = Loop(*units)
    driven = loop.drive(range(seconds))
    loop.reset()
    return driven, Loop(*units)


def test_the_whole_page_is_listed(units, trip, fmi):
    controller, _ = units
    tunable = [v for v in controller.description.modelVariables if v.variability == "tunable"]
    page = GENERATED[fmi](trip).library.values.calibration.entries
    assert len(page) == {"2": 24, "3": 28}[fmi]
    shares = {"SOC": "1"}
    assert [
        (v.name, v.causality, v.unit, float(v.min), float(v.max), float(v.start)) for v in tunable
    ] == [
        (e.name, "parameter", shares.get(e.unit, e.unit), e.least, e.most, e.default) for e in page
    ]
    assert controller.get(*(e.name for e in page)) == [e.default for e in page]


def test_set_before_departure_it_is_calibrate_in_python(units, trip, fmi):
    controller, plant = units
    Loop(controller, plant, tuned=FULLER).drive(range(trip.steps))
    calibrated = GENERATED[fmi](trip)
    calibrated.calibrate(FULLER)
    expected_g = simulate(trip, calibrated).fuel_g
    assert plant.get("fuel_total_g")[0] == pytest.approx(expected_g, abs=WITHIN_G[fmi])
    assert expected_g > simulate(trip, CONTROLLERS[fmi]).fuel_g + 5.0  # 0.02 of the battery
    assert controller.logged == []


def test_set_under_way_it_acts_from_the_next_command_on(units, fmi):
    expected, loop = as_it_is(units, 200)
    before = loop.drive(range(100))
    loop.controller.set(t_max_degc=60.0, t_cl_min_degc=52.0, t_min_degc=53.0)
    after = loop.drive(range(100, 200))
    assert before == expected[:100]
    assert after != expected[100:]
    assert flags(after) == {0}


@pytest.mark.parametrize("value", [1.01, -1.0, float("nan")])
def test_a_number_beyond_its_bounds_is_discarded(units, value):
    controller, plant = units
    loop = Loop(controller, plant)
    loop.drive(range(3))
    controller.logged.clear()
    with pytest.raises(FMICallException) as caught:
        controller.set(soc_min=value)
    assert caught.value.status == DISCARD
    assert controller.logged == [f"soc_min is {value:.9g}: it must be 0.04 to 1"]
    assert controller.get("soc_min") == [0.4]
    assert flags(loop.drive(range(3, 6))) == {0}


def test_numbers_that_contradict_are_refused_until_they_are_right(units):
    """A warning and a flag each second; what is driven is as with the page before."""
    expected, loop = as_it_is(units, 60)
    controller = loop.controller
    first = loop.drive(range(40))
    controller.set(soc_min=0.9)
    refused = loop.drive(range(40, 50))
    assert controller.logged == 10 * [CONTRADICTION]
    assert flags(refused) == {64}
    controller.set(soc_min=0.4)
    last = loop.drive(range(50, 60))
    assert [second[:FLAGS] for second in first + refused + last] == [
        second[:FLAGS] for second in expected
    ]
    assert len(controller.logged) == 10
    assert flags(last) == {0}
