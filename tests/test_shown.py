"""Text of files and arguments reaches terminals and pages without effect on them."""

import logging
from io import StringIO

from hostile import AS_SHOWN, TEXT, is_harmless
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from qpmpc import remarks
from qpmpc.errors import InputError
from qpmpc.report.html import html_page
from qpmpc.report.table import ShownTable
from qpmpc.shown import is_plain, shown


def test_what_is_escaped_and_what_is_not():
    assert shown(TEXT) == AS_SHOWN
    for text in ("", "naïve Größe °C ±", "日本", "🚗", "12\u00a0km", r"C:\x1b", "a 'b' \"c\""):
        assert shown(text) == text
    # C0, DEL, C1, ends of lines and paragraphs, changes of direction, an undecodable byte
    for code in (*range(32), *range(0x7F, 0xA0), 0x2028, 0x2029, 0x061C, 0x200E, 0x200F):
        assert shown(chr(code)).startswith("\\")
    for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0xFEFF, 0xDCFF, 0xE0041):
        assert shown(chr(code)).startswith("\\")


@given(st.text())
def test_what_is_shown_is_plain_and_can_be_encoded(text):
    assert is_plain(shown(text))
    shown(text).encode("utf-8")
    assert shown(shown(text)) == shown(text)


def test_every_error_of_ours_is_one_harmless_line():
    assert str(InputError(f"cycle {TEXT}: too short")) == f"cycle {AS_SHOWN}: too short"


def test_what_is_said_while_a_program_runs_is_harmless(caplog):
    with caplog.at_level(logging.WARNING):
        remarks.say_once(f"vehicle {TEXT}")
    assert [record.getMessage() for record in caplog.records] == [f"vehicle {AS_SHOWN}"]


def test_cells_and_title_of_a_table_are_plain_text():
    table = ShownTable(title=f"title {TEXT}")
    table.add_column("name")
    table.add_row(TEXT)
    text = StringIO()
    Console(file=text, width=200).print(table)
    assert is_harmless(text.getvalue())
    assert text.getvalue().count(AS_SHOWN) == 2  # no markup taken either


def test_a_page_escapes_markup_and_control_characters(tmp_path, monkeypatch):
    (tmp_path / "some_templates").mkdir()
    (tmp_path / "some_templates" / "__init__.py").touch()
    (tmp_path / "some_templates" / "page.j2").write_text('<p title="{{ text }}">{{ text }}</p>\n')
    monkeypatch.syspath_prepend(tmp_path)
    inner = AS_SHOWN.replace("<", "&lt;").replace(">", "&gt;")
    page = html_page("some_templates", "page.j2", text=TEXT)
    assert page == f'<p title="{inner}">{inner}</p>'
