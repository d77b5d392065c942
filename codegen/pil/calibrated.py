"""A trip in QEMU in which numbers are changed over XCP while it runs, beside one as it is."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from qpmpc.closed_loop import drive
from qpmpc.codegen.a2l.description import LAYOUTS, address_of, described
from qpmpc.codegen.a2l.image import Image
from qpmpc.codegen.firmware import Target, make_firmware, require_tools
from qpmpc.codegen.generate import Algorithm, Precision, algorithm_of, generate, one_of
from qpmpc.codegen.method import Generated, Method
from qpmpc.codegen.pil.loop import OnTarget
from qpmpc.codegen.values import Values
from qpmpc.codegen.xcp import XcpMaster
from qpmpc.controllers.base import Decision, Progress
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.files import write_text
from qpmpc.problems import shown_value
from qpmpc.results import Run
from qpmpc.trip import Observation, Trip

A2L = "controller.a2l"


@dataclass(frozen=True)
class Change:
    """A number written before a second, in SI units."""

    name: str
    number: float
    second: int

    @classmethod
    def parsed(cls, text: str) -> "Change":
        """Return the change that NAME=VALUE@SECOND says.

        Raises
        ------
        InputError
            If it says none.
        """
        name, _, rest = text.partition("=")
        number, _, second = rest.partition("@")
        try:
            change = cls(name.strip(), float(number), int(second))
        except ValueError:
            raise InputError(
                f"--calibrate {shown_value(text)}: expected NAME=VALUE@SECOND, such as "
                "soc_min=0.5@100"
            ) from None
        if change.second < 0:
            raise InputError(f"--calibrate {shown_value(text)}: the second must not be negative")
        return change


@dataclass(frozen=True)
class Changed:
    """What became of a change.

    Attributes
    ----------
    change : what was written
    address, before : where, and the number that was there
    refused : by the controller, which flagged it
    wrong_entry : the number that it named, empty if none
    differs_from : first second from then on with another command than without any change; None if
        there is none, and where it is refused
    """

    change: Change
    address: int
    before: float
    refused: bool
    wrong_entry: str
    differs_from: int | None

    def as_data(self) -> dict[str, Any]:
        """Return plain data, ready for JSON; null where a number is none or infinite."""
        return {
            "name": self.change.name,
            "value": _finite(self.change.number),
            "second": self.change.second,
            "address": self.address,
            "before": _finite(self.before),
            "refused": self.refused,
            "wrong_entry": self.wrong_entry,
            "command_differs_from_s": self.differs_from,
        }


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


@dataclass(frozen=True)
class CalibratedRun:
    """Both trips, what became of each change, flags of each second of the changed one, the A2L."""

    plain: Run
    run: Run
    changes: tuple[Changed, ...]
    flags: tuple[int, ...]
    a2l: str

    def as_data(self) -> dict[str, Any]:
        """Return the figures as plain data, ready for JSON."""
        runs = {"as_it_is": self.plain.summary(), "calibrated": self.run.summary()}
        return {"changes": [change.as_data() for change in self.changes], **runs}


class _Tool(OnTarget):
    """The firmware as a controller, with a calibration tool at its serial line."""

    def __init__(
        self, trip: Trip, method: Method, target: Target, a2l: Path, changes: Sequence[Change]
    ) -> None:
        super().__init__(trip, method, target, "xcp")
        self._master, self._a2l, self._changes = XcpMaster(target.exchange), a2l, changes
        self.written: dict[int, tuple[int, float]] = {}  # by place in `changes`: address, before
        self.wrong_entries: list[int] = []

    def step(self, seen: Observation) -> Decision:
        """Write what is due, then get the command."""
        due = [(i, c) for i, c in enumerate(self._changes) if c.second == seen.step]
        if due:
            self._master.connect()
            for i, change in due:
                self.written[i] = self._write(change)
            self._master.disconnect()
        decision = super().step(seen)
        self.wrong_entries.append(self.last_out.wrong_entry)
        return decision

    def _write(self, change: Change) -> tuple[int, float]:
        address, layout = address_of(self._a2l, change.name)
        form = f"<{LAYOUTS[layout]}"
        (before,) = struct.unpack(form, self._master.read(address, struct.calcsize(form)))
        self._master.write(address, struct.pack(form, change.number))
        return address, before


def calibrated_trip(
    trip: Trip,
    changes: Sequence[Change],
    settings: ControllerSettings | None = None,
    precision: Precision = "f32",
    algorithm: Algorithm = "admm",
    controller: Generated = "mh-qp",
    progress: Progress | None = None,
) -> CalibratedRun:
    """Drive a trip twice on the firmware in QEMU: with changes over XCP while it runs, and without.

    Addresses are looked up by name in an A2L file made of the firmware.

    Parameters
    ----------
    trip, settings, precision, algorithm, controller : as of `processor_in_the_loop`
    changes : to be written, each before its second
    progress : called as progress(steps done, steps in all) of both trips

    Raises
    ------
    CodegenError
        If a tool is missing, or the firmware does not fit or answer.
    InputError
        If there is no such number, or the trip ends before its second.
    """
    method = Method.of(controller, settings or ControllerSettings())
    values = method.values(trip.vehicle, method.horizon.block_count(trip.forecast.steps))
    _check(changes, values, trip)
    require_tools()
    with TemporaryDirectory(prefix="qpmpc-xcp-") as scratch:
        folder = Path(scratch)
        generate(values, folder, "cortex-m7", precision, algorithm_of(values, algorithm))
        elf = make_firmware(folder, "XCP=1")
        return drive_calibrated(trip, changes, method, values, precision, elf, progress)


def _check(changes: Sequence[Change], values: Values, trip: Trip) -> None:
    for change in changes:
        one_of(change.name, values.calibration.names, "number of the calibration")
        if change.second >= trip.steps:
            raise InputError(
                f"{change.name}={change.number:g}@{change.second}: the trip ends after "
                f"{trip.steps} s"
            )


def drive_calibrated(
    trip: Trip,
    changes: Sequence[Change],
    method: Method,
    values: Values,
    precision: Precision,
    elf: Path,
    progress: Progress | None = None,
) -> CalibratedRun:
    """Drive both trips on firmware built with XCP=1; parameters as of `calibrated_trip`."""

    def part(number: int) -> Progress | None:
        if progress is None:
            return None
        return lambda done, total: progress(number * total + done, 2 * total)

    a2l, text = elf.parent / A2L, described(Image(elf)).text
    write_text(a2l, text)
    with Target(elf, values, precision, elf.parent, has_line=True) as target:
        plain = drive(trip, _Tool(trip, method, target, a2l, ()), progress=part(0))
        tool = _Tool(trip, method, target, a2l, changes)
        run = drive(trip, tool, progress=part(1))
    names = values.calibration.names
    return CalibratedRun(
        plain,
        run,
        tuple(_became(tool, i, names, plain, run) for i in range(len(changes))),
        tuple(tool.flags),
        text,
    )


def _became(tool: _Tool, i: int, names: Sequence[str], plain: Run, run: Run) -> Changed:
    change = tool._changes[i]
    second, (address, before) = change.second, tool.written[i]
    refused = bool(tool.flags[second] & Flag.BAD_CALIBRATION)
    apart = np.flatnonzero(run.trajectory.p_eng_w[second:] != plain.trajectory.p_eng_w[second:])
    return Changed(
        change,
        address,
        before,
        refused,
        names[tool.wrong_entries[second]] if refused else "",
        second + int(apart[0]) if len(apart) and not refused else None,
    )
