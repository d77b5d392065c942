"""The log of a board: lines found in noise, checked one by one and as a whole."""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.generate import Precision
from qpmpc.errors import InputError
from qpmpc.input_text import read_bytes

MEGABYTES_MAX = 64
FORMAT = 1
UNITS = ("cycles", "ns", "instructions")
HZ_MAX = 4_000_000_000
FLAGS_MAX = 63
_TAG = re.compile(r"QPMPC(\d+),")
_SUM = re.compile(r"^(.*)\*([0-9a-fA-F]{8})\s*$")
_NUMBER = r"(\d{1,10})"
_FIELDS = {
    "start": r"([0-9a-f]{16}),([\w.+-]{1,40}),([\w-]{1,40}),(f32|f64),"
    rf"{_NUMBER},([a-z]{{1,20}}),{_NUMBER},([\w .-]{{1,40}})",
    "depart": rf"{_NUMBER},{_NUMBER}",
    "step": rf"{_NUMBER},{_NUMBER},{_NUMBER},([0-9a-fA-F]{{8}}|[0-9a-fA-F]{{16}}),"
    r"([01]),([012]),(\d{1,2})",
    "end": ",".join([_NUMBER] * 5),
}
_FORMS = {kind: re.compile(rf"{kind},{fields}", re.ASCII) for kind, fields in _FIELDS.items()}
SHOWN_SECONDS = 3
SIZES = ("state_bytes", "forecast_bytes", "stack_bytes", "flash_bytes", "ram_bytes")


class _Line(NamedTuple):
    """A line of the log: its number in the file, kind and fields; empty if it is damaged."""

    number: int
    kind: str
    fields: tuple[str, ...]
    wrong: str = ""


@dataclass(frozen=True)
class BoardLog:
    """A whole log.

    Attributes
    ----------
    identity, version, controller, precision : of the project that was built
    unit : of all times: cycles, ns or instructions
    hz : cycles a second; 0 if not known
    board : its name
    slices, slice_most : of the departure: their number; the longest
    forecast, step : time of each second for the forecast and for the controller, shape (seconds,)
    power_w, engine_on, rung, flags : commands, and where they came from, shape (seconds,)
    state_bytes, forecast_bytes : of one controller and one forecast
    stack_bytes, flash_bytes, ram_bytes : of the program, by the board; 0 if not known
    remarks : what was left out, one line each
    """

    identity: str
    version: str
    controller: str
    precision: Precision
    unit: str
    hz: int
    board: str
    slices: int
    slice_most: int
    forecast: NDArray[np.int64]
    step: NDArray[np.int64]
    power_w: NDArray[np.float64]
    engine_on: NDArray[np.bool_]
    rung: NDArray[np.int64]
    flags: NDArray[np.int64]
    state_bytes: int
    forecast_bytes: int
    stack_bytes: int
    flash_bytes: int
    ram_bytes: int
    remarks: tuple[str, ...]


def read_log(path: Path) -> BoardLog:
    """Read the last run of a log, which must be whole.

    Lines that are not of the log (of a boot loader, of other programs), and everything before the
    last line `start`, are left out and counted in `remarks`.

    Raises
    ------
    InputError
        If the file cannot be read, has no run, or its last run has a damaged line, a second twice,
        missing or out of order, or no end. The line names what is wrong and where.
    """
    owner = f"--from-log {path}"
    content = read_bytes(path, MEGABYTES_MAX, "--from-log ")
    texts = re.split("\r\n|\n|\r", content.decode("latin-1"))
    found = [
        _line(number, text[tag.start() :], int(tag[1][:9]))
        for number, text in enumerate(texts, start=1)
        if (tag := _TAG.search(text))
    ]
    starts = [k for k, line in enumerate(found) if line.kind == "start"]
    if not starts:
        why = f" (line {found[0].number}: {found[0].wrong})" if found and found[0].wrong else ""
        raise InputError(f"{owner}: no line QPMPC{FORMAT},start with a right checksum{why}")
    run = found[starts[-1] :]
    noise = sum(bool(text.strip("\0 \t")) for text in texts) - len(found)
    remarks = []
    if noise:
        remarks.append(f"{noise} lines that are not of the log are left out")
    if starts[-1]:
        remarks.append(f"{starts[-1]} lines of the log before its last start are left out")
    return _whole(run, owner, tuple(remarks))


def _line(number: int, text: str, version: int) -> _Line:
    """Check one line by itself."""
    if version != FORMAT:
        return _Line(number, "", (), f"is of format {version}, and format {FORMAT} is read")
    summed = _SUM.match(text)
    if summed is None:
        return _Line(number, "", (), "is cut off: no checksum at its end")
    body, checksum = summed[1], int(summed[2], 16)
    if crc32(body.encode("latin-1")) != checksum:
        return _Line(number, "", (), f"is damaged: its checksum is not {checksum:08x}")
    content = body.partition(",")[2]
    kind = content.partition(",")[0]
    form = _FORMS[kind].fullmatch(content) if kind in _FORMS else None
    if form is None:
        return _Line(number, "", (), f"is none of format {FORMAT}: {body[:60]!r}")
    return _Line(number, kind, form.groups())


def _whole(run: Sequence[_Line], owner: str, remarks: tuple[str, ...]) -> BoardLog:
    """Check that a run has each line once, in order; return its content."""
    for line in run:
        if line.wrong:
            raise InputError(f"{owner}: line {line.number} {line.wrong}")
    (_, _, start), steps = run[0][:3], [line for line in run if line.kind == "step"]
    identity, version, controller, precision, count, unit, hz, board = start
    seconds = int(count)
    if unit not in UNITS or int(hz) > HZ_MAX or not seconds:
        units = ", ".join(UNITS)
        raise InputError(
            f"{owner}: line {run[0].number} must have 1 second or more, a unit ({units}) and at "
            f"most {HZ_MAX} Hz"
        )
    _check_seconds([int(line.fields[0]) for line in steps], seconds, steps, owner)
    for kind in ("depart", "end"):
        number = sum(line.kind == kind for line in run)
        if number != 1:
            what = "is cut off: no line" if not number else f"has {number} times a line"
            raise InputError(f"{owner}: the run {what} {kind!r}")
    order = [line.kind for line in run]
    if order != ["start", "depart", *["step"] * seconds, "end"]:
        raise InputError(f"{owner}: lines out of order: start, depart, every second, end")
    single = precision == "f32"
    power_w = [_real(line, single, owner) for line in steps]
    columns = np.array([[int(line.fields[k]) for k in (1, 2, 4, 5, 6)] for line in steps])
    if columns[:, 4].max() > FLAGS_MAX:
        raise InputError(f"{owner}: flags above {FLAGS_MAX}")
    slices, slice_most = (int(field) for field in run[1].fields)
    sizes = [int(field) for field in run[-1].fields]
    return BoardLog(
        identity=identity,
        version=version,
        controller=controller,
        precision="f32" if single else "f64",
        unit=unit,
        hz=int(hz),
        board=board,
        slices=slices,
        slice_most=slice_most,
        forecast=columns[:, 0],
        step=columns[:, 1],
        power_w=np.array(power_w),
        engine_on=columns[:, 2] == 1,
        rung=columns[:, 3],
        flags=columns[:, 4],
        **dict(zip(SIZES, sizes, strict=True)),
        remarks=remarks,
    )


def _check_seconds(found: list[int], seconds: int, steps: Sequence[_Line], owner: str) -> None:
    seen: dict[int, int] = {}
    for second, line in zip(found, steps, strict=True):
        if second in seen:
            where = f"lines {seen[second]} and {line.number}"
            raise InputError(f"{owner}: second {second} is there twice: {where}")
        if second >= seconds:
            raise InputError(f"{owner}: line {line.number}: second {second} of {seconds}")
        seen[second] = line.number
    missing = seconds - len(seen)
    if missing:
        first = [k for k in range(len(seen) + SHOWN_SECONDS) if k not in seen][:SHOWN_SECONDS]
        first = [k for k in first if k < seconds]
        more = ", ..." if missing > len(first) else ""
        names = ", ".join(str(k) for k in first)
        raise InputError(f"{owner}: {missing} of {seconds} seconds are missing: {names}{more}")
    if found != sorted(found):
        late = next(k for k in range(1, len(found)) if found[k] < found[k - 1])
        raise InputError(f"{owner}: line {steps[late].number}: second {found[late]} out of order")


def _real(line: _Line, single: bool, owner: str) -> float:
    """Return a number from its bits."""
    bits = line.fields[3]
    if len(bits) != (8 if single else 16):
        raise InputError(f"{owner}: line {line.number}: {bits} is not {8 if single else 16} digits")
    (value,) = struct.unpack(">f" if single else ">d", bytes.fromhex(bits))
    if not isfinite(value):
        raise InputError(f"{owner}: line {line.number}: engine power is not finite")
    return float(value)
