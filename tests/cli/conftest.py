"""A short trip as a user's file, and the command line run in this process."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from qpmpc.cli import main

SPEEDS_MPS = [
    0,
    0,
    2,
    4,
    6,
    8,
    10,
    11,
    12,
    12,
    12,
    12,
    12,
    13,
    14,
    14,
    14,
    14,
    12,
    10,
    7,
    4,
    1,
    0,
    0,
]


class Outcome(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str

    def assert_refused(self, *words: str) -> None:
        """Bad input: exit code 2, and one line with these words."""
        assert self.code == 2
        assert self.out == ""
        assert self.err.startswith("qpmpc: ")
        assert self.err.count("\n") == 1
        assert self.err.endswith("\n")
        for word in words:
            assert word in self.err


@pytest.fixture
def trip(tmp_path: Path) -> Path:
    """A drive of 48 s: from a stop to 50 km/h and back."""
    file = tmp_path / "short.csv"
    rows = "".join(f"{2 * i},{speed}\n" for i, speed in enumerate(SPEEDS_MPS))
    file.write_text("time_s,speed_mps\n" + rows)
    return file


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    def run(*args: object) -> Outcome:
        with pytest.raises(SystemExit) as stop:
            main([str(arg) for arg in args])
        captured = capsys.readouterr()
        assert isinstance(stop.value.code, int)
        return Outcome(stop.value.code, captured.out, captured.err)

    return run


@pytest.fixture
def strict_json() -> Callable[[str], Any]:
    """Parse JSON as the standard has it: without NaN and infinity, which Python would take."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return lambda text: json.loads(text, parse_constant=refuse)


@pytest.fixture
def no_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    """As after an installation of the core alone: looking for it fails, importing it too."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
