"""The plant's sanity targets on EPA's cycles."""

import pytest

from qpmpc.cycles import load_cycle
from qpmpc.vehicle import DEFAULT_VEHICLE
from qpmpc.verification.epa.figures import (
    CASES,
    OFF_EPA,
    TOLERANCE,
    US06,
    main,
    model_mpg,
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_model_reproduces_its_reference(case):
    assert model_mpg(case) == pytest.approx(case.reference_mpg, rel=TOLERANCE)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_default_car_is_close_to_the_dynamometer(case):
    assert model_mpg(case, DEFAULT_VEHICLE) == pytest.approx(case.epa_mpg, rel=OFF_EPA)


def test_us06_is_the_published_schedule():
    """EPA: 8.01 mi, 80.3 mph at most."""
    cycle = load_cycle(US06)
    assert cycle.distance_m / 1609.344 == pytest.approx(8.01, abs=0.005)
    assert cycle.speed_mps.max() / 0.44704 == pytest.approx(80.3, abs=0.05)


@pytest.mark.slow
def test_the_command_shows_both_figures(capsys):
    assert main() == 0
    shown = capsys.readouterr().out
    assert "EPA" in shown
    assert "46.4" in shown
