"""Pictures: real images that show what they should."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.registry import controller_names
from qpmpc.report.cycle_picture import draw_cycle
from qpmpc.report.pwa_curves import pwa_curves
from qpmpc.report.pwa_picture import draw_pwa
from qpmpc.report.style import BLUE, CONTROLLER_STYLES, GREEN, ORANGE, VERMILION
from qpmpc.report.trajectories import draw_trajectories
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle, vehicle_names


def pixels_of(png: bytes, color: str) -> int:
    """Number of pixels of a colour, up to what rounding to 8 bits does."""
    image = imread(BytesIO(png), format="png")[..., :3]
    return int(np.sum(np.all(np.abs(image - to_rgb(color)) < 0.01, axis=-1)))


def test_trajectories_show_each_run_and_the_power_split(runs):
    png = draw_trajectories(runs)
    for color in (ORANGE, BLUE, *(CONTROLLER_STYLES[run.controller][0] for run in runs)):
        assert pixels_of(png, color) > 100


def test_the_seconds_of_faults_are_shaded():
    trip = load_cycle("nycc")
    faults = [{"kind": "wild", "at_s": 100, "for_s": 100}]
    plain, faulted = (simulate(trip, "ecms", faults=given) for given in (None, faults))
    images = [imread(BytesIO(draw_trajectories([run]))) for run in (plain, faulted)]
    differs = np.abs(images[0] - images[1]).max(axis=(0, 2)) > 0.01  # by column of pixels
    assert 0.12 < differs.mean() < 0.18  # 100 of 598 s, less the margins


def test_trajectories_of_one_run(runs):
    alone, both = draw_trajectories(runs[1:]), draw_trajectories(runs)
    height = [imread(BytesIO(png), format="png").shape[0] for png in (alone, both)]
    assert height[0] < height[1]  # a panel less


def test_pictures_can_be_repeated(runs):
    assert draw_trajectories(runs) == draw_trajectories(runs)


def test_every_name_has_a_colour_of_its_own():
    known = [name for name in controller_names() if name in CONTROLLER_STYLES]
    assert set(known) == set(controller_names())
    colors = [color for color, _ in CONTROLLER_STYLES.values()]
    assert len(set(colors)) == len(colors)


def test_cycle_shows_a_grade_only_where_there_is_one():
    flat = load_cycle("nycc")
    hilly = Cycle("hilly", flat.time_s, flat.speed_mps, 0.05 * np.sin(flat.time_s / 50))
    assert pixels_of(draw_cycle(flat), GREEN) == 0
    assert pixels_of(draw_cycle(hilly), GREEN) > 100


@pytest.mark.parametrize("name", vehicle_names())
def test_pwa_errors_stay_within_the_bounds_drawn(name):
    curves = pwa_curves(load_vehicle(name))
    for curve in curves:
        assert -curve.fit.below <= curve.error.min() <= curve.error.max() <= curve.fit.above
    assert pixels_of(draw_pwa(name, curves), VERMILION) > 100
