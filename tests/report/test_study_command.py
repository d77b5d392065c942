"""The command that repeats a run: exact, and inert whatever the names are."""

import shlex
import subprocess

import numpy as np
import pytest
from hostile import TEXT
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from qpmpc.cli.app import app
from qpmpc.report.study.command import quoted, repeat_command
from qpmpc.settings import parse_setting
from qpmpc.shown import is_plain

ROW = {"run": 17, "cycle": "nycc", "vehicle": "prius-nimh", "controller": "mh-qp", "seed": 3}


def test_what_differs_from_the_default_is_given():
    row = ROW | {
        "forecast": "speed-noise",
        "faults": "my faults.toml",
        "set.thermal.t_amb_degc": np.float64(-7.5),
        "set.mh_qp.admm.iterations": 25.0,
        "set.rule_based.balance": np.bool_(True),
        "set.rule_based.on_w": np.nan,
        "set.mh_qp.solver": None,
        "fuel_g": 123.0,
    }
    assert shlex.split(repeat_command(row)) == [
        *("qpmpc", "simulate", "nycc", "--controller", "mh-qp", "--vehicle", "prius-nimh"),
        *("--forecast", "speed-noise:3", "--inject", "my faults.toml"),
        *("--set", "thermal.t_amb_degc=-7.5", "--set", "mh_qp.admm.iterations=25"),
        *("--set", "rule_based.balance=true", "--out", "run_17"),
    ]


@pytest.mark.parametrize("forecast", ["true", None, np.nan])
def test_the_true_forecast_needs_no_option(forecast):
    assert "--forecast" not in repeat_command(ROW | {"forecast": forecast})


# an argument holds no NUL; surrogates stand for bytes of a file name that are no UTF-8
WORDS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)


def test_words_reach_the_program_as_they_are():
    """bash itself gives them back."""
    words = ["", "$(rm -rf x)", "`id`", "a'b\"c", TEXT, "\udcff", "é\x9b", "\\x41", "!!", "~", "*"]

    @given(st.lists(WORDS, max_size=10))
    @settings(max_examples=10, deadline=None)
    def draw(more):
        words.extend(more)

    draw()
    line = " ".join(map(quoted, words))
    assert is_plain(line)
    done = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {line}"], capture_output=True, check=True,
        env={"LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    assert done.stdout.split(b"\0")[:-1] == [w.encode("utf-8", "surrogateescape") for w in words]


@given(WORDS | st.floats(allow_nan=False) | st.integers() | st.booleans())
@settings(deadline=None)
def test_settings_are_read_as_the_same_value(value):
    command = repeat_command(ROW | {"seed": 0, "set.a.b": value})
    if not command.isascii() or "$'" in command:
        return  # shlex knows no escapes; bash is asked above
    (text,) = [
        word
        for before, word in zip(shlex.split(command), shlex.split(command)[1:], strict=False)
        if before == "--set"
    ]
    assert parse_setting(text) == ("a.b", value)


def test_a_name_like_an_option_is_no_option(tmp_path):
    words = shlex.split(repeat_command(ROW | {"cycle": "--json=x"}))[1:]
    result = CliRunner().invoke(app, [*words[:-4], "--out", str(tmp_path), *words[-2:]])
    assert str(result.exception).startswith("unknown cycle '--json=x'")


def test_a_command_drives_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    row = ROW | {"controller": "ecms", "set.thermal.t_amb_degc": -7.0}
    result = CliRunner().invoke(app, shlex.split(repeat_command(row))[1:])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "run_17" / "nycc_ecms.json").exists()
