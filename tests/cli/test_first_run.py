"""What helps somebody who has never used the command: the first words, hints, completion."""

import os
import re
import subprocess
import sys

import pytest
import shellingham
import typer

from qpmpc.cli.app import app
from qpmpc.cli.first_run import FIRST_RUN

COMMANDS = typer.main.get_command(app).commands


def test_without_a_command_the_next_ones_are_said(cli):
    assert cli() == (0, FIRST_RUN, "")
    said = re.findall(r"^  qpmpc (\S+)", FIRST_RUN, re.MULTILINE)
    assert 3 <= len(said) <= 4
    assert set(said) <= COMMANDS.keys()
    assert max(map(len, FIRST_RUN.splitlines())) <= 100
    options = {name for each in COMMANDS["compare"].params for name in each.opts}
    assert {"--controllers", "--out"} <= options


@pytest.mark.parametrize(
    ("args", "meant"),
    [
        (["simulat", "nycc"], "'simulate'"),
        (["simulate", "nycc", "--contoller", "x"], "--controller"),
        (["simulate", "nyc"], "'nycc'"),
        (["simulate", "nycc", "--vehicle", "prius"], "'prius-nimh'"),
        (["simulate", "nycc", "--controller", "mh_qp"], "'mh-qp'"),
        (["simulate", "nycc", "--set", "thermal.t_amb=1"], "'t_amb_degc'"),
        (["simulate", "nycc", "--set", "thermol.t_amb_degc=1"], "'thermal'"),
        (["simulate", "nycc", "--set", "mh_qp.implementation=pyton"], "'python'"),
        (["simulate", "nycc", "--set", "mh_qp.solver=pipq"], "'piqp'"),
        (["simulate", "nycc", "--set", "mh_qp.solver=qpsolvers:osq"], "'osqp'"),
        (["simulate", "nycc", "--forecast", "stop"], "'stops'"),
        (["compare", "nycc", "--plant", "fastsin"], "'fastsim'"),
        (["sweep", "wether"], "'weather'"),
        (["studies", "wether"], "'weather'"),
        (["trips", "juge"], "'judge'"),
        (["trips", "juge-001"], "'judge-001'"),
        (["simulate", "juge-001"], "'judge-001'"),
        (["simulate", "JUDGE_7"], "'judge-007'"),
        (["simulate", "judge-1"], "'judge-001'"),
        (["compare", "rando-123"], "'random-123'"),
        (["simulate", "ramdom-5-600"], "'random-5-600s'"),
        (["verify", "--only", "balance"], "'balances'"),
        (["codegen", "x", "--precision", "f23"], "'f32'"),
        (["codegen", "x", "--target", "cortex"], "'cortex-m7'"),
        (["benchmark", "--controllers", "hpimp"], "'hpipm'"),
    ],
)
def test_the_nearest_name_is_in_the_error(cli, args, meant):
    cli(*args).assert_refused(meant)


def test_the_nearest_unit_is_in_the_error(cli, trip, tmp_path):
    done = cli("convert", trip, "--out", tmp_path / "y.csv", "--speed-unit", "knot")
    done.assert_refused("did you mean 'knots'")


def completed(words: str) -> list[str]:
    """Names that bash is given for the last word, as its completion script asks for them."""
    number = len(words.split()) - (not words.endswith(" "))
    asked = {"_QPMPC_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(number)}
    done = subprocess.run(
        [sys.executable, "-m", "qpmpc"],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_the_shell_completes_commands_and_names():
    assert completed("qpmpc simula") == ["simulate"]
    assert completed("qpmpc compare nycc --controllers ecms,rule") == ["ecms,rule-based"]


@pytest.mark.parametrize(
    ("command", "parameter", "begun", "name"),
    [
        ("simulate", "cycle", "nyc", "nycc"),
        ("cycles", "name", "wl", "wltc-3b"),
        ("simulate", "vehicle", "prius-l", "prius-liion"),
        ("vehicles", "name", "prius-l", "prius-liion"),
        ("simulate", "controller", "rule", "rule-based"),
        ("codegen", "controller", "mh-c", "mh-costate"),
        ("sweep", "study", "weath", "weather"),
        ("studies", "name", "weath", "weather"),
        ("verify", "only", "bou", "bounds"),
        ("compare", "plant", "fastsim-", "fastsim-sonata"),
        ("trips", "name", "ju", "judge"),
        ("simulate", "set_", "thermal.t_a", "thermal.t_amb_degc="),
        ("simulate", "set_", "mh_qp.admm.it", "mh_qp.admm.iterations="),
    ],
)
def test_each_kind_of_name_is_completed(command, parameter, begun, name):
    with typer.Context(COMMANDS[command]) as context:
        (found,) = [each for each in COMMANDS[command].params if each.name == parameter]
        assert [item.value for item in found.shell_complete(context, begun)] == [name]
        assert found.shell_complete(context, "\0no such") == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_offered_for_the_shell_around(cli, monkeypatch, shell):
    monkeypatch.setattr(shellingham, "detect_shell", lambda: (shell, f"/bin/{shell}"))
    done = cli("--show-completion")
    assert done.code == 0
    assert f"_QPMPC_COMPLETE=complete_{shell}" in done.out
