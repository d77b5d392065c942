import subprocess
import sys

import pytest

from qpmpc import __version__

COMMANDS = ["simulate", "compare", "codegen", "pil", "benchmark", "cycles", "vehicles", "doctor"]


def test_version(cli):
    assert cli("--version") == (0, f"qpmpc-iptm {__version__}\n", "")


def test_help_lists_the_commands(cli):
    done = cli("--help")
    assert (done.code, done.err) == (0, "")
    for command in COMMANDS:
        assert command in done.out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples(cli, command):
    done = cli(command, "--help")
    assert done.code == 0
    assert done.out.count(f"qpmpc {command}") >= 3  # usage and at least two examples


def test_help_loads_nothing_heavy():
    script = (
        "import sys\n"
        "from qpmpc.cli import main\n"
        "try: main(['compare', '--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted({'numpy', 'scipy', 'osqp', 'matplotlib'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"
