"""Import of a user's drive from CSV, with one clear line about any error."""

import csv
import io
from array import array
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.log_columns import is_log, parse_log
from qpmpc.cycles.plausibility import check_motion, check_road, check_samples
from qpmpc.cycles.suspicion import suspicions
from qpmpc.errors import InputError
from qpmpc.input_text import read_text
from qpmpc.remarks import say_once

MEGABYTES_MAX = 64
"""24 h at 25 samples a second."""

NOISE_MPS = 0.05
"""Of a speed sensor while the car stands."""

AGAIN_MAX = 0.05
"""Share of rows that may repeat the time of the row before, as where a logger hiccups."""

REQUIRED = ("time_s", "speed_mps")
OPTIONAL = ("grade",)
ALLOWED_TEXT = "time_s,speed_mps[,grade]"


def read_csv(path: Path, *, name: str | None = None) -> Cycle:
    """Read a drive and interpolate it linearly at whole seconds.

    The columns are ``time_s,speed_mps[,grade]``, or those of a log with units of its own
    (`qpmpc.cycles.log_columns`); what was assumed and left out then becomes a remark. Columns may
    come in any order, time steps may be uneven, time may start anywhere. A byte order mark, Windows
    line ends, spaces around names and blank lines at the end do not matter. Speeds down to -0.05
    m/s are those of a standing car; a few rows with the time of the row before are left out.

    Parameters
    ----------
    path
        UTF-8 text: time in s, speed in m/s, grade as rise over run, unless the columns say other
        units.
    name
        Name of the cycle; the stem of the file if absent.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed: unreadable file, columns other
        than the above, values that are not numbers or out of range, time that does not increase,
        a gap, a trip too short or too long, or motion that no road vehicle is capable of, as when
        speeds in km/h or mph are given as m/s (see `qpmpc.cycles.plausibility`). What is possible
        but unusual becomes a remark of the cycle (see `qpmpc.cycles.suspicion`).
    """
    text = read_text(path, MEGABYTES_MAX)
    lines: Sequence[int]
    said: list[str] = []
    if is_log(text) and not _is_plain(text):
        log = parse_log(path, text)
        lines, time, speed, grade = log.lines, log.time_s, log.speed_mps, log.grade
        said += log.remarks
    else:
        lines, table = _table(path, text)
        time, speed = table["time_s"], table["speed_mps"]
        grade = table.get("grade", np.zeros(len(time)))
    lines, time, speed, grade = _repaired(path, lines, time, speed, grade, said)
    check_samples(path, lines, time, speed, grade)
    cycle = Cycle.from_samples(name if name is not None else path.stem, time, speed, grade)
    check_motion(path, lines, time, cycle)
    check_road(path, cycle)
    remarks = tuple(f"{path}: {remark}" for remark in (*said, *suspicions(cycle)))
    for remark in remarks:
        say_once(remark)
    return replace(cycle, remarks=remarks)


def _is_plain(text: str) -> bool:
    """Whether it is a table of the columns of `ALLOWED_TEXT`, whose rows begin with a number."""
    first, _, rest = text.lstrip().partition("\n")
    titles = [title.strip().strip('"') for title in first.split(",")]
    cells = rest.lstrip().partition("\n")[0].split(",")
    if set(titles) - set(REQUIRED + OPTIONAL) or len(cells) != len(titles):
        return False
    try:
        float(cells[titles.index("time_s")])
    except ValueError:
        return False
    return True


def _repaired(
    path: Path,
    lines: Sequence[int],
    time_s: Floats,
    speed_mps: Floats,
    grade: Floats,
    said: list[str],
) -> tuple[Sequence[int], Floats, Floats, Floats]:
    """Take noise of a standing car for 0, and leave out rows whose time is that of the last."""
    noise = (speed_mps < 0.0) & (speed_mps > -NOISE_MPS)
    if np.any(noise):
        said.append(f"{int(np.sum(noise))} speeds between -{NOISE_MPS:g} and 0 m/s taken for 0")
        speed_mps = np.where(noise, 0.0, speed_mps)
    again = np.append(False, np.diff(time_s) == 0.0)
    if np.any(again):
        share = float(np.mean(again))
        if share > AGAIN_MAX:
            line = lines[int(np.argmax(again))]
            raise InputError(
                f"{path}, line {line}: {share:.0%} of the rows have the time of the row before: "
                "time must increase strictly; give it with decimals"
            )
        said.append(f"{int(np.sum(again))} rows with the time of the row before left out")
        kept = np.flatnonzero(~again)
        lines = [lines[k] for k in kept.tolist()]
        time_s, speed_mps, grade = time_s[kept], speed_mps[kept], grade[kept]
    return lines, time_s, speed_mps, grade


def _table(path: Path, text: str) -> tuple[Sequence[int], dict[str, Floats]]:
    """Line number of each row, and its numbers by column; blank lines at the end are dropped.

    Row by row, so that a file that is no table is refused at its first line, whatever its length.
    """
    if not text.strip(" \t\r\n,"):
        raise InputError(f"{path}: the file is empty; it needs a header {ALLOWED_TEXT} and rows")
    reader = csv.reader(io.StringIO(text, newline=""))
    rows = ((reader.line_num, [cell.strip() for cell in row]) for row in reader)
    lines, numbers = array("q"), array("d")
    blank: list[tuple[int, list[str]]] = []
    try:
        columns = _columns(path, next(rows)[1])
        for line, cells in rows:
            if not any(cells):
                blank = blank or [(line, cells)]
                continue
            for first, nothing in blank:  # a blank line, but not at the end
                _numbers(path, first, nothing, columns)
            lines.append(line)
            numbers.extend(_numbers(path, line, cells, columns))
    except csv.Error:
        raise InputError(f"{path}: not a CSV file: it must be plain text in UTF-8") from None
    if len(lines) < 2:
        raise InputError(f"{path}: {len(lines)} row(s) below the header, at least 2 are needed")
    table = np.array(numbers).reshape(len(lines), len(columns))
    return lines, {column: table[:, k] for k, column in enumerate(columns)}


def _columns(path: Path, header: list[str]) -> list[str]:
    """Check the header; returns the column names in the file's order."""
    if set(REQUIRED) <= set(header) <= set(REQUIRED + OPTIONAL) and len(header) == len(set(header)):
        return header
    found = ",".join(header)
    if len(found) > 80:
        found = found[:77] + "..."
    raise InputError(
        f"{path}, line 1: columns found: {found!r}; a time and a speed with units are needed, "
        f"as in 'Time [s],Speed [km/h]'; allowed: {ALLOWED_TEXT}"
    )


def _numbers(path: Path, line: int, cells: list[str], columns: list[str]) -> list[float]:
    """Convert one row."""
    if len(cells) != len(columns):
        found = "a blank line" if not any(cells) else f"{len(cells)} value(s)"
        raise InputError(
            f"{path}, line {line}: {found}, but the header has {len(columns)} columns: "
            f"{','.join(columns)}"
        )
    numbers = []
    for column, cell in zip(columns, cells, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            shown = cell if len(cell) <= 40 else cell[:37] + "..."
            raise InputError(f"{path}, line {line}: {column} is {shown!r}, must be a finite number")
        numbers.append(number)
    return numbers
