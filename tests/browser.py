"""What every report must do in a real browser, without network."""

import csv
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
PAPER = "getComputedStyle(document.body).backgroundColor"
NOTHING = "\N{EN DASH}"
A4 = 718  # pixels between margins of 1 cm
WHITE = "rgb(255, 255, 255)"


@contextmanager
def chromium() -> Iterator[Any]:
    """Start the browser; where there is none, skip."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no chromium")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


@contextmanager
def opened(browser: Any, file: Path, **keywords: Any) -> Iterator[Any]:
    """Open a page as a user would, and see to it that nothing was asked for or went wrong."""
    said: list[str] = []
    context = browser.new_context(offline=True, **keywords)
    page = context.new_page()
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: said.append(request.url))
    page.goto(file.as_uri())
    yield page
    context.close()
    asked = [text for text in said if not text.startswith(("data:image/png", "blob:"))]
    assert asked == [file.as_uri()]


def assert_works(file: Path, charts: int, tables: int, browser: Any = None) -> None:
    """Try everything that pages share: answer, tables, charts, colours, print, a narrow window.

    Parameters
    ----------
    charts, tables : how many the page has
    browser : where one is started already
    """
    with nullcontext(browser) if browser else chromium() as started:
        wide = {"width": 1280, "height": 720}
        with opened(started, file, viewport=wide, color_scheme="dark") as page:
            box = page.locator(".answer").bounding_box()
            assert box["y"] + box["height"] < wide["height"]
            assert (page.evaluate(CHARTS), page.locator("table.data").count()) == (charts, tables)
            assert page.evaluate(FOLDED) == 0
            _assert_tables(page)
            _assert_charts(page)
            for rows in (False, True):
                _assert_zoom(page, rows)
            dark = page.evaluate(PAPER)
            assert dark != WHITE
            page.locator("button.theme").click()
            assert page.evaluate(PAPER) == WHITE
            page.set_viewport_size({"width": 400, "height": 700})
            page.evaluate(NARROWED)  # charts follow the window in one of the next frames
            assert max(page.evaluate(WIDTHS), default=0) <= 400
            assert page.evaluate("document.documentElement.scrollWidth") <= 400
            assert page.evaluate(LOST) == []
            page.set_viewport_size({"width": A4, "height": 1000})
            page.emulate_media(media="print")
            assert page.evaluate("document.documentElement.scrollWidth") <= A4
            assert page.evaluate(PAPER) == WHITE
            pictures = page.locator("figure.chart > img")
            assert all(picture.is_visible() for picture in pictures.all())
            assert page.locator(".plots:visible, button:visible:not(th button)").count() == 0


CHARTS = "[...document.querySelectorAll('figure.chart')].flatMap(f => f.charts).length"
# what is folded cannot be clicked
FOLDED = "(document.querySelectorAll('details').forEach(d => { d.open = true; }), 0)"
WIDTHS = "[...document.querySelectorAll('.uplot')].map(plot => plot.offsetWidth)"
# names of rows that leave the window when their table is scrolled to the right
LOST = """[...document.querySelectorAll('.scroll')].flatMap(box => {
  box.scrollLeft = 1e4;
  return [...box.querySelectorAll('tbody tr')].map(row => row.cells[0])
    .filter(cell => cell.matches('.name') && cell.getBoundingClientRect().left < 0)
    .map(cell => cell.innerText);
})"""
NARROWED = f"""new Promise(done => {{
  let frames = 0;
  const look = () => (
    frames++ > 100 || Math.max(0, ...{WIDTHS}) <= 400 ? done() : requestAnimationFrame(look)
  );
  look();
}})"""


def _assert_tables(page: Any) -> None:
    """Each sorts by its first column, and its CSV is what it shows."""
    found = page.evaluate(
        """async () => {
          const made = [];
          const create = URL.createObjectURL;
          URL.createObjectURL = blob => { made.push(blob); return create(blob); };
          const all = [];
          for (const table of document.querySelectorAll("table.data")) {
            const heading = table.tHead.rows[0].cells[0];
            heading.querySelector("button").click();
            table.parentElement.previousElementSibling.querySelector("button").click();
            const shown = [...table.rows].map(row => [...row.cells].map(cell => cell.innerText));
            const named = [...table.tHead.rows[0].cells].every(cell => cell.innerText.trim());
            all.push([heading.getAttribute("aria-sort"), named, shown, await made.pop().text()]);
          }
          return all;
        }"""
    )
    for sorted_, named, shown, text in found:
        assert sorted_ == "ascending"
        assert named, "a heading without text cannot be clicked"
        lines = list(csv.reader(StringIO(text)))
        assert [list(map(_one_line, row)) for row in lines] == [
            list(map(_one_line, row)) for row in shown
        ]


def _assert_zoom(page: Any, rows: bool) -> None:
    """Dragging to the right zooms the first chart of the kind, a double click shows all again."""
    over = page.evaluate_handle(
        """rows => [...document.querySelectorAll("figure.chart")].flatMap(f => f.charts)
          .map(chart => chart.panels[0].plot)
          .find(plot => (plot.scales.x.ori === 1) === rows)?.over || null""",
        rows,
    ).as_element()
    if over is None:
        return

    def ends() -> list[float]:
        found: list[float] = over.evaluate(
            """(over, rows) => {
              const of = [...document.querySelectorAll("figure.chart")].flatMap(f => f.charts)
                .flatMap(chart => chart.panels).find(({plot}) => plot.over === over).plot.scales;
              return rows ? [of.y.min, of.y.max] : [of.x.min, of.x.max];
            }""",
            rows,
        )
        return found

    before = ends()
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 4, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20, steps=3)
    page.mouse.up()
    low, high = ends()
    assert before[0] < low < high < before[1]
    over.dblclick()
    assert ends() == before


def _one_line(cell: str) -> str:
    return " ".join(cell.split())


DRAWN = """() => [...document.querySelectorAll('figure.chart')].every(figure =>
  figure.charts.every(chart => chart.panels.every(({plot}) => {
    const {width, height} = plot.ctx.canvas;
    return plot.ctx.getImageData(0, 0, width, height).data.some(byte => byte !== 0);
  })))"""


def _assert_charts(page: Any) -> None:
    """Every box leaves its lines out of every panel; the cursor tells values; all are drawn."""
    found = page.evaluate(
        """() => [...document.querySelectorAll('figure.chart')].flatMap(figure => {
          const tools = [...figure.querySelectorAll('.tools')];
          return figure.charts.map((chart, k) => {
            const boxes = [...tools[k].querySelectorAll('input')];
            const shown = name => chart.panels.flatMap(({plot, panel}) =>
              panel.series.filter((s, i) => s.group === name && plot.series[i + 1].show)).length;
            const toggled = boxes.map(box => {
              const name = box.parentElement.innerText.trim();
              const before = shown(name);
              box.click();
              const without = shown(name);
              box.click();
              return [name, before, without, shown(name)];
            });
            const told = chart.panels.map(({plot, panel}) => {
              const row = panel.series.findIndex(s => s.values.some(v => v !== null));
              const i = plot.data[row + 1].findIndex(v => v !== null);
              const along = plot.valToPos(plot.data[0][i], 'x');
              const value = plot.valToPos(plot.data[row + 1][i], 'y');
              const upright = plot.scales.x.ori === 1;
              plot.setCursor({left: upright ? value : along, top: upright ? along : value});
              return plot.root.querySelector('.u-legend .u-value').innerText;
            });
            return {toggled, told};
          });
        })"""
    )
    for chart in found:
        for name, before, without, after in chart["toggled"]:
            assert before == after > without == 0, name
        assert all(text and text != NOTHING and "Point at" not in text for text in chart["told"]), (
            chart
        )
    page.wait_for_function(DRAWN)  # in one of the next frames; else it fails
