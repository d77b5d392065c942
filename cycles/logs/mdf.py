"""Measurement files of the automotive industry (ASAM MDF 3 and 4): channels as columns."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from qpmpc.cycles.cycle import Floats
from qpmpc.cycles.logs.apart import read_apart
from qpmpc.cycles.logs.choose import columns_of, scale_of
from qpmpc.cycles.logs.columns import ASSUMED, LEFT_OUT, READ, LogColumns, Said
from qpmpc.cycles.logs.extra import need
from qpmpc.cycles.logs.quantities import ELEVATION, GRADE, SPEED, TIME, LogOptions, Quantity
from qpmpc.delimited import Column, plain_unit, split_title
from qpmpc.errors import InputError
from qpmpc.input_text import check_path
from qpmpc.problems import names_shown, shown_value

MEGABYTES_MAX = 1000
"""Of which only the channels of a drive are read."""

SIGNATURES = (b"MDF ", b"UnFinMF ")
MASTERS = (2, 3)
"""Types of channels that are the time of the others (MDF 4), or that it is computed from."""


@dataclass(frozen=True)
class _Channel:
    """A channel, the first of its name that has samples."""

    column: Column
    group: int
    index: int
    again: int


def read_mdf(path: Path, options: LogOptions) -> LogColumns:
    """Read the channels of speed, grade and elevation; units are those of the file.

    Grade and elevation are interpolated at the times of the speed.

    Raises
    ------
    InputError
        If the file is no MDF, a channel is not there, is no number or names no unit that is known,
        or if the options have no effect or contradict.
    """
    need(path, "asammdf")
    for stated, option in (
        (TIME.name in options.units, TIME.option),
        (options.trip is not None, "--trip"),
    ):
        if stated:
            raise InputError(f"{path}: {option} has no effect on an MDF file")
    _check_file(path)
    return read_apart(read_here, path, options)


def read_here(path: Path, options: LogOptions) -> LogColumns:
    """Read a file in this process, which a broken one may end.

    Raises
    ------
    InputError
        As `read_mdf`.
    """
    from asammdf import MDF

    try:
        with MDF(path) as file:
            return _read(path, file, options)
    except InputError:
        raise
    except Exception as error:  # of asammdf: the file is another's bytes
        raise InputError(
            f"{path}: not an MDF file that asammdf reads: {shown_value(str(error))}"
        ) from None


def _check_file(path: Path) -> None:
    check_path(path)
    try:
        with path.open("rb") as opened:
            begin = opened.read(8)
            size = opened.seek(0, 2)
    except OSError as error:
        reasons = {FileNotFoundError: "no such file", IsADirectoryError: "is a directory"}
        reason = reasons.get(type(error), f"cannot be read: {error.strerror}")
        raise InputError(f"{path}: {reason}") from None
    if size > MEGABYTES_MAX * 1_000_000:
        raise InputError(f"{path}: larger than {MEGABYTES_MAX} MB, the most that is read")
    if not begin.startswith(SIGNATURES):
        raise InputError(f"{path}: not an MDF file: it does not begin as one")


def _read(path: Path, file: Any, options: LogOptions) -> LogColumns:
    channels = list(_channels(file))
    of_title = {channel.column.title: channel for channel in channels}
    columns = [channel.column for channel in channels]
    speeds, grades, heights = (
        columns_of(path, columns, quantity, options) for quantity in (SPEED, GRADE, ELEVATION)
    )
    if not speeds:
        like = [column.title for column in columns if column.unit in SPEED.units]
        found = f"such as {names_shown(like)}" if like else "none is in a unit of speed"
        raise InputError(
            f"{path}: no channel is called {SPEED.names[0]}, {SPEED.names[3]} or alike: name it "
            f"with qpmpc convert --speed-column; {found}"
        )
    for quantity, there in ((GRADE, grades), (ELEVATION, heights)):
        if not there and quantity.name in options.units:
            raise InputError(f"{path}: {quantity.option}: there is no channel of {quantity.name}")
    said: list[Said] = []
    time_s, speed_mps = _samples(path, file, of_title[speeds[0].title], SPEED, options, said)
    if len(time_s) < 2:
        raise InputError(f"{path}: {len(time_s)} sample(s) of speed, at least 2 are needed")
    others: dict[str, Floats] = {}
    for quantity, there in ((GRADE, grades), (ELEVATION, heights)):
        if there and not others:
            at_s, values = _samples(path, file, of_title[there[0].title], quantity, options, said)
            if len(at_s):
                others[quantity.name] = np.interp(time_s, at_s, values)
        elif there:
            text = f"{quantity.name} {shown_value(there[0].title)}: the grade is there"
            said.append(Said(LEFT_OUT, text))
    if not others:
        said.append(Said(ASSUMED, "a level road: no channel of grade or elevation"))
    return LogColumns(
        range(1, len(time_s) + 1),
        time_s,
        speed_mps,
        grade=others.get(GRADE.name),
        elevation_m=others.get(ELEVATION.name),
        said=tuple(said),
        row="sample",
    )


def _channels(file: Any) -> Iterator[_Channel]:
    """Channels with samples, each name once."""
    places: dict[str, list[tuple[int, int]]] = {}
    units: dict[str, str] = {}
    for g, group in enumerate(file.groups):
        master = file.masters_db.get(g)
        for i, channel in enumerate(group.channels):
            if i == master or not group.channel_group.cycles_nr:
                continue
            places.setdefault(channel.name, []).append((g, i))
            units.setdefault(channel.name, _unit(channel))
    for name, found in places.items():
        # "VehSpd\\XCP:1" and "ECU.VehSpd" are VehSpd
        short = re.split(r"[.:]", name.partition("\\")[0])[-1]
        column = Column(name, split_title(short)[0], plain_unit(units[name]), ())
        yield _Channel(column, *found[0], again=len(found) - 1)


def _unit(channel: Any) -> str:
    conversion = channel.conversion
    return str(channel.unit or (conversion.unit if conversion is not None else "") or "")


def _samples(
    path: Path,
    file: Any,
    channel: _Channel,
    quantity: Quantity,
    options: LogOptions,
    said: list[Said],
) -> tuple[Floats, Floats]:
    """Times and values that are numbers, in SI units."""
    title = shown_value(channel.column.title)
    scale, unit = scale_of(path, channel.column, quantity, options)
    signal = file.get(
        channel.column.title,
        group=channel.group,
        index=channel.index,
        ignore_invalidation_bits=True,  # else such samples would be missing without a word
    )
    if signal.samples.ndim != 1 or not np.issubdtype(signal.samples.dtype, np.number):
        raise InputError(f"{path}: channel {title} is no number over time")
    values = signal.samples.astype(np.float64)
    if signal.invalidation_bits is not None:
        values = np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, values)
    time_s = np.asarray(signal.timestamps, dtype=np.float64)
    said.append(Said(READ, f"{quantity.name} from channel {title}{unit}"))
    if channel.again:
        said.append(Said(LEFT_OUT, f"{channel.again} more channel(s) {title}: the first is read"))
    keep = np.isfinite(values) & np.isfinite(time_s)
    if not np.all(keep):
        text = f"{int(np.sum(~keep))} of {len(keep)} samples of {title} without a value left out"
        said.append(Said(LEFT_OUT, text))
    return time_s[keep], values[keep] * scale
