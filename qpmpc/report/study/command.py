"""The command that repeats a run of a study."""

import json
import shlex
from collections.abc import Mapping
from typing import Any

from qpmpc.report.study.figures import SETTING, is_nothing, plain
from qpmpc.settings import parse_setting
from qpmpc.shown import is_plain

TRUE_FORECAST = "true"
EXACT = 2.0**53  # floats up to here hold every integer


def repeat_command(row: Mapping[str, Any]) -> str:
    r"""Return the command that drives a run again, for bash or zsh.

    It is one line of printable characters: any others in names are written ``$'\x1b'``.

    Parameters
    ----------
    row : of the study's table: run, cycle, controller, vehicle and, where there are any, forecast,
        seed, faults and settings (``set.`` and the dotted name; empty ones have no effect)
    """
    options = ["--controller", str(row["controller"]), "--vehicle", str(row["vehicle"])]
    forecast, faults = plain(row.get("forecast")), plain(row.get("faults"))
    if forecast not in (None, TRUE_FORECAST):
        options += ["--forecast", f"{forecast}:{int(row['seed'])}"]
    if faults is not None:
        options += ["--inject", str(faults)]
    for column, value in row.items():
        if column.startswith(SETTING) and not is_nothing(value):
            options += ["--set", _setting(column.removeprefix(SETTING), plain(value))]
    options += ["--out", f"run_{int(row['run'])}"]
    cycle = str(row["cycle"])
    # a name that begins like an option comes last, where it cannot be one
    words = [*options, "--", cycle] if cycle.startswith("-") else [cycle, *options]
    return " ".join(["qpmpc", "simulate", *map(quoted, words)])


def quoted(word: str) -> str:
    """Return a word as the shell reads it, without characters that act on a terminal."""
    if is_plain(word):
        return shlex.quote(word)
    escaped = "".join(_escaped(character) for character in word)
    return f"$'{escaped}'"


def _escaped(character: str) -> str:
    if character in "'\\":
        return "\\" + character
    if is_plain(character):
        return character
    return "".join(f"\\x{byte:02x}" for byte in character.encode("utf-8", "surrogateescape"))


def _setting(key: str, value: Any) -> str:
    """Return KEY=VALUE that is read as the same value."""
    if isinstance(value, bool):
        return f"{key}={str(value).lower()}"
    if isinstance(value, float):
        # a column of integers with gaps holds floats
        whole = value.is_integer() and abs(value) < EXACT
        return f"{key}={int(value) if whole else repr(value)}"
    if isinstance(value, str) and (not value.strip() or parse_setting(f"-={value}")[1] != value):
        return f"{key}={json.dumps(value, ensure_ascii=False)}".replace("\x7f", "\\u007f")
    return f"{key}={value}"
