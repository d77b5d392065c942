"""The HTML report: complete, self-contained, honest."""

import re
from base64 import b64decode

import pytest
from pages import Page, assert_self_contained

from qpmpc import __version__
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.report.columns import COMPARE_COLUMNS, filled
from qpmpc.report.compare_html import compare_html
from qpmpc.report.trajectories import draw_trajectories
from qpmpc.results import compare_runs


@pytest.fixture(scope="module")
def source(runs):
    pictures = {runs[0].cycle: draw_trajectories(runs)}
    return compare_html(runs, compare_runs(runs), ControllerSettings(), pictures)


@pytest.fixture(scope="module")
def page(source):
    return Page(source)


def test_nothing_is_loaded_from_elsewhere(source):
    assert_self_contained(source)


def test_picture_is_inside(page):
    (image,) = [attributes["src"] for tag, attributes in page.tags if tag == "img"]
    data = b64decode(image.removeprefix("data:image/png;base64,"), validate=True)
    assert data.startswith(b"\x89PNG")


def test_names_cannot_inject_markup(page, runs):
    assert "<b>" in runs[0].cycle
    assert runs[0].cycle in page.text
    assert "b" not in {tag for tag, _ in page.tags}


def test_table_has_every_figure(page, rows):
    for row in rows:
        for column in filled(COMPARE_COLUMNS, rows):
            assert column.text(row) in page.text


def test_what_was_run_is_told(page, runs):
    assert __version__ in page.text
    assert runs[1].solver in page.text
    assert "logical cores" in page.text
    assert "cold_iterations" in page.text
    for section, values in runs[0].vehicle.model_dump(exclude={"name", "description"}).items():
        for key, value in values.items():
            told = re.search(rf"{section}\.{key}(?!_)", page.text) is not None
            assert told == (value is not None)


def test_tightness_of_the_relaxation_is_told(page, rows):
    fractional = 100.0 * (1.0 - rows[1]["sigma_integral_share"])
    assert "How tight the relaxation was" in page.text
    assert f"{fractional:.1f}" in page.text
    assert f"{100.0 * rows[1]['relaxation_gap']['max']:.2f}" in page.text


def changed(runs, **changes):
    rows = compare_runs(runs)
    rows[0]["comparable"] = True  # whatever the rules reach on a trip this short
    rows[1].update(changes)
    return Page(compare_html(runs, rows, ControllerSettings(), {})).text


def test_violations_fallbacks_and_doubts_are_told(runs, page):
    assert "No limit was violated" in page.text
    text = changed(runs, violations={"soc": 0.0, "t_cl_degc": 0.5, "power_w": 0.0})
    assert "Limits were violated by: mh-qp" in text
    assert "fallback drove" not in page.text
    assert "(3 s)" in changed(runs, fallback_steps=3)
    assert "* not comparable" not in changed(runs, comparable=True)
    assert "* not comparable" in changed(runs, comparable=False)


def test_a_run_below_the_optimum_is_called_a_doubt(runs):
    rows = compare_runs(runs)
    rows[0].update(controller="dp", fuel_above_dp_percent=0.0)
    rows[1]["fuel_above_dp_percent"] = -0.25
    text = Page(compare_html(runs, rows, ControllerSettings(), {})).text
    assert "0.25 % below dp" in text
