"""Reports in a real browser, without network: what their scripts do."""

import csv
from contextlib import ExitStack

import pytest
from browser import assert_works, chromium
from browser import opened as opened_in

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.report.compare_html import compare_html
from qpmpc.report.trajectories import draw_trajectories
from qpmpc.results import compare_runs


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def file(runs, tmp_path_factory):
    pictures = {runs[0].cycle: draw_trajectories(runs)}
    page = compare_html(runs, compare_runs(runs), ControllerSettings(), pictures)
    path = tmp_path_factory.mktemp("page") / "compare.html"
    path.write_text(page, "utf-8")
    return path


@pytest.fixture
def opened(browser, file):
    with ExitStack() as stack:
        yield lambda **keywords: stack.enter_context(opened_in(browser, file, **keywords))


def cells(page, column):
    return page.locator("table[data-file=compare] tbody tr").evaluate_all(
        "(rows, column) => rows.map(row => row.cells[column].innerText)", column
    )


def range_of(page, panel):
    scale = f"document.querySelector('figure.chart').chart.panels[{panel}].plot.scales.x"
    return page.evaluate(f"[{scale}.min, {scale}.max]")


def test_the_first_screen_says_the_answer(opened, rows):
    page = opened(viewport={"width": 1280, "height": 720})
    answer = page.locator(".answer")
    box = answer.bounding_box()
    assert box["y"] + box["height"] < 720
    assert rows[0]["cycle"] in answer.inner_text()
    assert "<b>[red]" in page.locator("h2", has_text="long_name").inner_text()


def test_a_table_is_sorted_by_keyboard_and_says_so(opened, rows):
    page = opened()
    heading = page.locator("table[data-file=compare] th", has_text="fuel g")
    fuel = [f"{grams:.1f}" for grams in sorted(row["fuel_g"] for row in rows)]
    assert fuel != sorted(fuel)  # as text the order would be another
    for direction, expected in (("ascending", fuel), ("descending", fuel[::-1])):
        heading.locator("button").focus()
        page.keyboard.press("Enter")
        assert heading.get_attribute("aria-sort") == direction
        assert cells(page, 2) == expected
    name = page.locator("table[data-file=compare] th", has_text="controller")
    name.locator("button").click()
    assert heading.get_attribute("aria-sort") is None
    assert cells(page, 1) == sorted(row["controller"] for row in rows)


def test_the_csv_is_the_table(opened, rows, tmp_path):
    page = opened()
    with page.expect_download() as waiting:
        page.locator("button", has_text="Download CSV").first.click()
    assert waiting.value.suggested_filename == "compare.csv"
    waiting.value.save_as(tmp_path / "compare.csv")
    with (tmp_path / "compare.csv").open(encoding="utf-8", newline="") as text:
        lines = list(csv.DictReader(text))
    assert [line["controller"] for line in lines] == [row["controller"] for row in rows]
    assert [line["cycle"] for line in lines] == [row["cycle"] for row in rows]
    assert [line["fuel g"] for line in lines] == [f"{row['fuel_g']:.1f}" for row in rows]


def test_a_downloaded_cell_is_no_formula(opened, tmp_path):
    cells = ["=1+1", "+cmd|' /C calc'!A0", "@SUM(A1)", "-2+3", "-0.5", "+0.3 [-0.1, 0.7]", "-"]
    page = opened()
    page.locator("table[data-file=compare] tbody tr").first.evaluate(
        "(row, cells) => cells.forEach((text, i) => { row.cells[i].textContent = text; })", cells
    )
    with page.expect_download() as waiting:
        page.locator("button", has_text="Download CSV").first.click()
    waiting.value.save_as(tmp_path / "compare.csv")
    with (tmp_path / "compare.csv").open(encoding="utf-8", newline="") as text:
        _, first, *_ = csv.reader(text)
    assert first[: len(cells)] == [*(f"'{cell}" for cell in cells[:4]), *cells[4:]]


def test_a_controller_is_left_out_of_every_panel(opened):
    page = opened()
    figure = page.locator("figure.chart")
    assert figure.locator(".panel:visible").count() == 6
    figure.get_by_label("mh-qp").uncheck()
    assert figure.locator(".panel:visible").count() == 5
    shown = (
        "document.querySelector('figure.chart').chart.panels.map("
        "p => p.plot.series.filter(s => s.show).map(s => s.label)).slice(3).flat()"
    )
    assert "mh-qp" not in page.evaluate(shown)
    figure.get_by_label("mh-qp").check()
    assert "mh-qp" in page.evaluate(shown)


def test_zoom_is_linked(opened):
    page = opened()
    whole = range_of(page, 0)
    over = page.locator("figure.chart .u-over")
    over.first.scroll_into_view_if_needed()
    box = over.first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 4, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20, steps=4)
    page.mouse.up()
    zoomed = range_of(page, 0)
    length = whole[1] - whole[0]
    # a pixel of the drag is less than 1 % of the axis
    assert zoomed[0] == pytest.approx(whole[0] + length / 4, abs=0.01 * length)
    assert zoomed[1] == pytest.approx(whole[0] + length / 2, abs=0.01 * length)
    assert all(range_of(page, i) == zoomed for i in range(6))
    page.get_by_role("button", name="All", exact=True).click()
    assert [range_of(page, i) for i in range(6)] == [whole] * 6
    page.get_by_role("button", name="Zoom in").focus()
    page.keyboard.press("Enter")
    assert range_of(page, 5)[1] - range_of(page, 5)[0] == pytest.approx(length / 2)


def test_the_value_under_the_cursor_is_shown_in_every_panel(opened, runs):
    page = opened()
    over = page.locator("figure.chart .u-over")
    over.first.scroll_into_view_if_needed()
    over.first.hover()
    at = page.locator("figure.chart .u-legend tr:first-child .u-value")
    seconds = set(at.all_inner_texts())
    assert len(seconds) == 1
    (second,) = seconds
    found = page.locator(".panel", has_text="SOC").locator(".u-value").all_inner_texts()
    expected = runs[0].trajectory.soc[int(second.removeprefix("s "))]
    assert float(found[1]) == pytest.approx(expected, abs=1e-4)  # four digits are shown


def test_what_all_pages_share(browser, file):
    assert_works(file, charts=1, tables=3, browser=browser)


@pytest.mark.slow
def test_without_scripts_the_pictures_are_there(opened):
    page = opened(java_script_enabled=False)
    assert page.locator("figure.chart > img").is_visible()
