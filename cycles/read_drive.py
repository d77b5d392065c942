"""A user's drive from a file: read, repaired, checked, at 1 Hz; one clear line about any error."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qpmpc.cycles.cycle import Cycle, Floats
from qpmpc.cycles.logs.columns import LEFT_OUT, UNUSUAL, LogColumns, Said
from qpmpc.cycles.logs.elevation import with_grade
from qpmpc.cycles.logs.quantities import NOTHING_STATED, LogOptions
from qpmpc.cycles.logs.read import read_log
from qpmpc.cycles.logs.repair import repaired
from qpmpc.cycles.logs.split import at_gaps, by_trip
from qpmpc.cycles.plausibility import check_grade, check_motion, check_road, check_samples
from qpmpc.cycles.suspicion import suspicions
from qpmpc.errors import InputError


class Drive(NamedTuple):
    """A drive, and what it was made of.

    Attributes
    ----------
    cycle : at 1 Hz; its remarks are `said`, each with the file before it
    log : its samples after repair
    said : what was read, assumed, repaired and left out, and what is unusual
    """

    cycle: Cycle
    log: LogColumns
    said: tuple[Said, ...]


class Drives(NamedTuple):
    """The drives of one file.

    Attributes
    ----------
    drives : in the file's order, at least one
    said : where the file was split, and what was left out between
    """

    drives: list[Drive]
    said: list[Said]


def read_drive(path: Path, *, name: str | None = None) -> Cycle:
    """Read a drive and interpolate it linearly at whole seconds.

    A table has the columns ``time_s,speed_mps[,grade]``, or those of a log with units of its own;
    GPX and MDF are read as well (`qpmpc.cycles.logs`). What was assumed, repaired and left out
    becomes a remark of the cycle. Columns may come in any order, time steps may be uneven, time may
    start anywhere. A byte order mark, Windows line ends, spaces around names and blank lines at the
    end do not matter. Speeds down to -0.05 m/s are those of a standing car; a few rows with the
    time of the row before are left out.

    Parameters
    ----------
    path
        Table in UTF-8: time in s, speed in m/s, grade as rise over run, unless the columns say
        other units; or a GPX or MDF file.
    name
        Name of the cycle; the stem of the file if absent.

    Raises
    ------
    InputError
        One line that names the file, the line and what is allowed: unreadable file, columns other
        than the above, values that are not numbers or out of range, time that does not increase,
        a gap, several trips, a trip too short or too long, or motion that no road vehicle is
        capable of, as when speeds in km/h or mph are given as m/s (see
        `qpmpc.cycles.plausibility`). What is possible but unusual becomes a remark of the cycle
        (see `qpmpc.cycles.suspicion`).
    """
    (drive,) = read_drives(path, name=name).drives
    return drive.cycle


def read_drives(
    path: Path,
    options: LogOptions = NOTHING_STATED,
    *,
    split: bool = False,
    name: str | None = None,
) -> Drives:
    """Read the drives of a file: one, or with `split` one of each trip, ``NAME-1`` and so on.

    Parameters
    ----------
    path : of the file, see `read_drive`
    options : what the file does not say
    split : whether the file may have several trips (see `qpmpc.cycles.logs.split`); one that is
        no drive is then left out, and that is said
    name : of the cycles; the stem of the file if absent

    Raises
    ------
    InputError
        As of `read_drive`; with `split` if no trip is left.
    """
    stem = path.stem if name is None else name
    of_file = by_trip(path, read_log(path, options), options.trip, split)
    if not split:
        (log,) = of_file
        return Drives([_drive(path, stem, repaired(path, log))], [])
    parts: list[LogColumns] = []
    said: list[Said] = []
    refused = ""
    for log in of_file:
        try:
            found, of_log = at_gaps(repaired(path, log))
        except InputError as error:
            refused = str(error)
            said.append(Said(LEFT_OUT, _without(path, refused)))
            continue
        parts += found
        said += of_log
    drives: list[Drive] = []
    for log in parts:
        try:
            drives.append(_drive(path, f"{stem}-{len(drives) + 1}", log))
        except InputError as error:
            refused = str(error)
            said.append(Said(LEFT_OUT, _without(path, refused)))
    if not drives:
        raise InputError(refused or f"{path}: no trip in it: {'; '.join(s.text for s in said[:3])}")
    return Drives(drives, said)


def _drive(path: Path, name: str, log: LogColumns) -> Drive:
    check_samples(path, log.rows, log.time_s, log.speed_mps, _grade(log), log.row)
    if log.grade is None:
        log = with_grade(log)
        check_grade(path, log.rows, _grade(log), log.row, "from elevation, no road is so steep")
    cycle = Cycle.from_samples(name, log.time_s, log.speed_mps, _grade(log))
    check_motion(path, log.rows, log.time_s, cycle, log.row)
    check_road(path, cycle)
    said = (*log.said, *(Said(UNUSUAL, text) for text in suspicions(cycle)))
    remarks = tuple(f"{path}: {each.text}" for each in said)
    return Drive(replace(cycle, remarks=remarks), log, said)


def _grade(log: LogColumns) -> Floats:
    return np.zeros(len(log.time_s)) if log.grade is None else log.grade


def _without(path: Path, line: str) -> str:
    return line.removeprefix(str(path)).lstrip(":, ")
