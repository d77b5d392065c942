"""A vehicle as the text of a TOML file, complete and with the comments of its sources."""

import json
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from qpmpc.shown import is_plain, shown
from qpmpc.vehicle.load import VehicleFile, merged_vehicle, origins, vehicle_files
from qpmpc.vehicle.parameters import Vehicle

WIDTH = 100

_TABLE = re.compile(r"\s*\[\s*([\w-]+)\s*\]\s*(#.*)?$")
_KEY = re.compile(r"\s*([\w.-]+)\s*=(.*)$")
_BESIDE = re.compile(r"""(?:"(?:\\.|[^"\\])*"|'[^']*'|[^"'#])*(#.*)$""")


@dataclass(frozen=True)
class Comment:
    """Comments of one key: the lines above it, and the text beside its value."""

    above: tuple[str, ...] = ()
    beside: str = ""


def vehicle_file_text(name_or_path: str | Path) -> str:
    """Return a vehicle's file, with any base written out and all comments.

    Raises
    ------
    InputError
        If the vehicle cannot be loaded.
    """
    files = vehicle_files(name_or_path)
    vehicle = merged_vehicle(files)
    own = files[0]
    if len(files) == 1 and _harmless(own.text):
        return own.text if own.text.endswith("\n") else own.text + "\n"
    comments = _merged_comments(files)
    if bases := ", ".join(shown(file.label) for file in files[1:]):
        remark = f"# Written out in full from {shown(own.label)}, whose base is {bases}."
    else:
        remark = f"# Written out from {shown(own.label)}, whose control characters are escaped."
    head = comments_of(own.text).get("", Comment()).above
    return vehicle_toml(vehicle, {**comments, "": Comment((*head, remark))})


def vehicle_toml(vehicle: Vehicle, comments: Mapping[str, Comment] | None = None) -> str:
    """Write a vehicle as TOML, each number with all digits needed to load back equal.

    Parameters
    ----------
    comments : dotted key, or name of a table -> its comment; "" -> the lines at the top
    """
    known = comments or {}
    nothing = Comment()
    lines = [_comment_line(text) for text in known.get("", nothing).above]
    for name, value in vehicle.model_dump().items():
        comment = known.get(name, nothing)
        if not isinstance(value, dict):
            lines += _entry(name, _string(value), comment)
            continue
        lines += ["", *_entry(f"[{name}]", "", comment)]
        for key, number in value.items():
            if number is None:
                continue
            written = _array(key, number) if isinstance(number, tuple) else _scalar(number)
            lines += _entry(key, written, known.get(f"{name}.{key}", nothing))
    return "\n".join(lines) + "\n"


def comments_of(text: str) -> dict[str, Comment]:
    """Collect the comments of a TOML file whose tables are flat.

    Returns
    -------
    dotted key, or name of a table -> its comment, if any; "" -> the lines before the first key
    """
    found: dict[str, Comment] = {}
    table, at_top = "", True
    above: list[str] = []
    for line in text.split("\n"):
        stripped = line.strip()
        if stripped.startswith("#"):
            above.append(stripped)
            continue
        if header := _TABLE.match(line):
            table = header[1]
            key, beside = table, header[2] or ""
        elif entry := _KEY.match(line):
            key = f"{table}.{entry[1]}" if table else entry[1]
            comment = _BESIDE.match(entry[2])
            beside = comment[1] if comment else ""
        else:
            if stripped:  # inside an array or a string: comments there belong to no key
                above = []
            continue
        if at_top and above:
            found[""] = Comment(tuple(above))
            above = []
        if above or beside:
            found[key] = Comment(tuple(above), beside.strip())
        above, at_top = [], False
    return found


def _merged_comments(files: tuple[VehicleFile, ...]) -> dict[str, Comment]:
    """Comments of tables, and of values that apply: others would describe other values."""
    counts = origins(files)
    return {
        key: comment
        for file in reversed(files)
        for key, comment in comments_of(file.text).items()
        if counts.get(key) is file or isinstance(file.data.get(key), dict)
    }


def _entry(key: str, written: str, comment: Comment) -> list[str]:
    line = f"{key} = {written}" if written else key
    beside = f"  {_comment_line(comment.beside)}" if comment.beside else ""
    return [*map(_comment_line, comment.above), line + beside]


def _comment_line(text: str) -> str:
    return shown(text.expandtabs())


def _scalar(value: float | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _array(key: str, values: tuple[float, ...]) -> str:
    inside = ", ".join(repr(value) for value in values)
    if len(f"{key} = [{inside}]") <= WIDTH:
        return f"[{inside}]"
    wrapped = textwrap.fill(inside, WIDTH - 1, initial_indent="  ", subsequent_indent="  ")
    return f"[\n{wrapped},\n]"


def _string(text: str) -> str:
    # JSON escapes what TOML must; TOML has a longer escape, where JSON has two short ones
    return "".join(
        c if is_plain(c) else f"\\u{ord(c):04x}" if ord(c) <= 0xFFFF else f"\\U{ord(c):08x}"
        for c in json.dumps(text, ensure_ascii=False)
    )


def _harmless(text: str) -> bool:
    """Whether it holds no control characters but line ends and tabs."""
    return is_plain(text.replace("\n", "").replace("\t", ""))
