"""Quiet by default; with a level, what happens goes to stderr and never to stdout."""

import logging

import pytest

from qpmpc.codegen.library_cache import kept_file
from qpmpc.remarks import say_once


@pytest.fixture(autouse=True)
def log_as_before():
    logger = logging.getLogger("qpmpc")
    before = logger.level, logger.handlers[:]
    yield
    logger.setLevel(before[0])
    logger.handlers[:] = before[1]


RULES = ("--controller", "rule-based", "--json", "-")


def test_nothing_is_said_without_a_level(cli, trip):
    done = cli("simulate", trip, *RULES)
    assert done.code == 0
    assert "info:" not in done.err


def test_info_names_files_and_runs_and_stdout_is_json(cli, trip, strict_json):
    done = cli("--log-level", "info", "simulate", trip, *RULES)
    assert done.code == 0
    assert strict_json(done.out)
    lines = [line for line in done.err.splitlines() if line.startswith("info: qpmpc.")]
    assert any(f"read {trip}," in line for line in lines)
    assert any("rule-based departs on" in line for line in lines)
    assert "debug:" not in done.err


def test_info_tells_a_compiled_controller_from_a_kept_one(caplog, tmp_path, monkeypatch):
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))
    caplog.set_level(logging.INFO, logger="qpmpc")
    kept_file("key", ".so", lambda: b"content")
    assert "compiled now" in caplog.text
    caplog.clear()
    kept_file("key", ".so", lambda: b"content")
    assert "compiled now" not in caplog.text
    assert "compiled controller kept in" in caplog.text


def test_error_leaves_out_remarks(cli, capsys):
    cli("--log-level", "error", "vehicles")
    say_once("a remark that only this test makes")
    assert capsys.readouterr().err == ""
    cli("vehicles")
    say_once("another remark that only this test makes")
    assert capsys.readouterr().err == "another remark that only this test makes\n"


def test_a_hostile_name_is_escaped_in_the_log(cli, tmp_path, trip):
    file = tmp_path / "a\x1b[31m\nb.csv"
    file.write_bytes(trip.read_bytes())
    done = cli("--log-level", "info", "simulate", file, *RULES)
    assert done.code == 0
    assert "\x1b" not in done.err
    assert "a\\x1b[31m\\nb.csv" in done.err


def test_a_program_that_uses_the_package_hears_only_remarks(capsys):
    """No handler is added by importing: Python's own says warnings, and nothing below."""
    logging.getLogger("qpmpc").handlers[:] = []
    logging.getLogger("qpmpc").setLevel(logging.NOTSET)
    assert logging.getLogger("qpmpc.files").getEffectiveLevel() >= logging.WARNING
