"""What an FMU refuses: a status that says so, a logged reason, and nothing done."""

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated
from fmus import Unit

DISCARD, ERROR = 2, 3


@pytest.fixture(params=["2", "3"])
def plant(fmus, request):
    with Unit(fmus[f"plant{request.param}"]) as unit:
        yield unit


def refused(unit, call, message, status=ERROR):
    """Whether a call is refused with a message, alone in the log."""
    unit.logged.clear()
    with pytest.raises(FMICallException) as caught:
        call()
    assert caught.value.status == status
    assert unit.logged == [message]


@pytest.mark.parametrize("step_s", [0.5, 2.0, 0.0, -1.0, 1.001, float("nan")])
def test_a_step_that_is_not_a_second(plant, step_s):
    plant.start()
    refused(plant, lambda: plant.step(0.0, step_s), f"step size {step_s:.9g} s: it must be 1 s")
    plant.step(0.0)
    assert plant.get("time") == [1.0]


def test_a_step_from_another_time(plant):
    plant.start(start_s=10.0)
    refused(plant, lambda: plant.step(0.0), "step at 0 s: this instance is at 10 s")
    plant.step(10.0)
    assert plant.get("time") == [11.0]


def test_a_step_before_initialization(plant):
    refused(plant, lambda: plant.step(0.0), "a step is not allowed in instantiated mode")


def test_a_reference_that_there_is_not(plant):
    get = plant.fmu.getFloat64 if plant.is_fmi3 else plant.fmu.getReal
    set_ = plant.fmu.setFloat64 if plant.is_fmi3 else plant.fmu.setReal
    refused(plant, lambda: get([0, 99]), "value reference 99: there is none")
    refused(
        plant, lambda: set_([4_000_000_000], [1.0]), "value reference 4000000000: there is none"
    )


def test_a_value_of_another_type(plant):
    get = plant.fmu.getFloat64 if plant.is_fmi3 else plant.fmu.getReal
    place = plant.reference("engine_on")
    refused(plant, lambda: get([place]), f"value reference {place}: engine_on is of another type")


@pytest.mark.parametrize("name", ["soc", "time"])
def test_an_output_set(plant, name):
    message = f"{name} cannot be set: it is neither an input nor a parameter"
    refused(plant, lambda: plant.set(**{name: 0.5}), message)


def test_a_parameter_set_under_way(plant):
    plant.start()
    message = "soc_init is not allowed in step mode"
    refused(plant, lambda: plant.set(soc_init=0.5), message)


def test_a_parameter_that_is_out_of_range(plant):
    message = "soc_init is 1.5: it must be 0 to 1"
    refused(plant, lambda: plant.start(soc_init=1.5), message)


def test_a_step_beyond_the_trip(plant, trip):
    plant.start()
    told = [plant.step(t) for t in range(trip.steps)]
    if plant.is_fmi3:  # the end of the simulation is asked for
        assert [terminate for _, terminate, *_ in told] == (trip.steps - 1) * [False] + [True]
    end = f"step at {trip.steps} s: the trip has ended, at {trip.steps} s"
    refused(plant, lambda: plant.step(trip.steps), end, DISCARD)
    if not plant.is_fmi3:
        assert plant.fmu.getBooleanStatus(fmi2Terminated)
        assert plant.fmu.getRealStatus(fmi2LastSuccessfulTime) == trip.steps


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_token_of_another(fmus, fmi):
    with pytest.raises(Exception, match="nstantiate"):
        Unit(fmus[f"plant{fmi}"], guid="{another}")
