"""What third parties print while a command works does not reach stdout."""

import ctypes
import os
import subprocess
import sys

import pytest

import qpmpc.simulation
from qpmpc.cli import main

NOISE = b"ERROR in osqp_setup: noise"


def test_text_of_solvers_does_not_spoil_json(capfd, monkeypatch, strict_json, trip):
    drive = qpmpc.simulation.drive

    def noisy(*args, **options):
        print(NOISE.decode())
        ctypes.CDLL(None).puts(NOISE)  # kept in C's buffer
        os.write(1, NOISE + b"\n")
        return drive(*args, **options)

    monkeypatch.setattr("qpmpc.simulation.drive", noisy)
    with pytest.raises(SystemExit) as stop:
        main(["simulate", str(trip), "--json", "-"])
    out, err = capfd.readouterr()
    assert stop.value.code == 0
    assert strict_json(out)["cycle"] == "short"
    assert err.count(NOISE.decode()) == 3


def test_output_goes_on_afterwards_also_after_an_error():
    script = (
        "import ctypes\n"
        "from qpmpc.cli.stdout import to_stderr\n"
        "libc = ctypes.CDLL(None)\n"
        "libc.puts(b'before')\n"
        "try:\n"
        "    with to_stderr():\n"
        "        libc.puts(b'meanwhile')\n"
        "        raise ValueError\n"
        "except ValueError:\n"
        "    print('after')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == "before\nafter\n"
    assert done.stderr == "meanwhile\n"


def test_a_closed_stderr_is_no_error(trip):
    command = [sys.executable, "-m", "qpmpc", "simulate", str(trip), "--controller", "rule-based"]
    done = subprocess.run(
        ["sh", "-c", '"$@" 2>&-', "sh", *command], stdout=subprocess.PIPE, text=True
    )
    assert done.returncode == 0
    assert "balanced g" in done.stdout
