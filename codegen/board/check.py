"""A board's log against the same controller on this machine: commands compared, times told."""

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.board.log import BoardLog, read_log
from qpmpc.codegen.board.manifest import Manifest, load_manifest, load_sources
from qpmpc.codegen.board.project import checked_mhz
from qpmpc.codegen.c_compiler import CodegenError
from qpmpc.codegen.host_library import compiled, loaded, structures
from qpmpc.controllers.monitor import Flag
from qpmpc.errors import InputError

# Source and inputs are the same: what differs is round-off (fused multiply-add, the C library). In
# single precision it moves the power along a flat optimum, and may tip an on/off that is a tie.
TOLERANCE = {"f32": 0.03, "f64": 1e-6}  # of the engine's greatest power
TIES_A_HUNDRED = {"f32": 1, "f64": 0}  # seconds in a hundred, rounded up, that may differ by more
SHOWN_SECONDS = 5
SECOND_NS = 1e9
_SIZEOF_REAL, _SIZEOF_OUT = 1, 3  # entries of mpc_abi


@dataclass(frozen=True)
class Commands:
    """Commands of each second, shape (seconds,); power is 0 with the engine off."""

    power_w: NDArray[np.float64]
    engine_on: NDArray[np.bool_]
    rung: NDArray[np.int64]
    flags: NDArray[np.int64]


@dataclass(frozen=True)
class BoardResult:
    """A log that was checked.

    Attributes
    ----------
    manifest : of the project
    log : of the board
    expected : commands of the same controller on this machine
    clock_mhz : of the board's core; None if not known, or without effect
    """

    manifest: Manifest
    log: BoardLog
    expected: Commands
    clock_mhz: float | None

    @property
    def difference_w(self) -> NDArray[np.float64]:
        """|Power of the board - that of this machine|, shape (seconds,)."""
        return np.abs(self.log.power_w - self.expected.power_w)

    @property
    def tolerance_w(self) -> float:
        """Largest difference that round-off explains."""
        return TOLERANCE[self.log.precision] * self.manifest.power_max_w

    @property
    def differing(self) -> NDArray[np.intp]:
        """Seconds whose command differs by more than that, or in on or off."""
        flips = self.log.engine_on != self.expected.engine_on
        return np.flatnonzero(flips | (self.difference_w > self.tolerance_w))

    def milliseconds(self, times: float) -> float | None:
        """Return a time of the log in ms; None where its unit is none of time."""
        if self.log.unit == "ns":
            return times * 1e-6
        return None if self.clock_mhz is None else times / self.clock_mhz * 1e-3

    def summary(self) -> dict[str, Any]:
        """Return the figures as plain data, ready for JSON."""
        about, log = self.manifest, self.log
        difference = self.difference_w
        alike = log.engine_on == self.expected.engine_on
        equal = (difference == 0.0) & alike
        running = log.engine_on | self.expected.engine_on
        return {
            "cycle": about.cycle,
            "vehicle": about.vehicle,
            "controller": about.controller,
            "algorithm": about.algorithm,
            "precision": about.precision,
            "iterations": about.iterations,
            "board": log.board,
            "identity": log.identity,
            "version": log.version,
            "seconds": about.seconds,
            "trip_s": about.trip_s,
            "unit": log.unit,
            "clock_mhz": self.clock_mhz,
            "times": {
                "step": self._times(log.step),
                "forecast": self._times(log.forecast),
                "both": self._times(log.step + log.forecast),
            },
            "departure": {
                "slices": log.slices,
                "max": log.slice_most,
                "max_ms": self.milliseconds(log.slice_most),
            },
            "commands": {
                "equal_to_the_bit": int(equal.sum()),
                "engine_on_seconds": int(running.sum()),
                "engine_on_equal_to_the_bit": int((equal & running).sum()),
                "largest_difference_w": float(difference[alike].max(initial=0.0)),
                "tolerance_w": self.tolerance_w,
                "differ_by_more": [int(k) for k in self.differing],
            },
            "fallback_seconds": int(np.count_nonzero(log.rung)),
            "flagged_seconds": int(np.count_nonzero(log.flags)),
            "state_bytes": log.state_bytes,
            "forecast_bytes": log.forecast_bytes,
            "stack_bytes": log.stack_bytes or None,
            "flash_bytes": log.flash_bytes or None,
            "ram_bytes": log.ram_bytes + log.stack_bytes if log.ram_bytes else None,
            "remarks": list(self.remarks),
        }

    @property
    def remarks(self) -> list[str]:
        """What a reader should know, one line each."""
        said = list(self.log.remarks)
        if self.log.unit == "instructions":
            said.append("instructions were counted in an emulator: this is no time on silicon")
        if self.log.unit == "cycles" and self.clock_mhz is None:
            said.append("the clock is not known: give --clock-mhz to see milliseconds")
        if self.log.unit == "ns":
            said.append(
                "times are of the clock on the wall: the system's interruptions are in them"
            )
        return said

    def _times(self, times: NDArray[np.int64]) -> dict[str, Any]:
        median = float(np.median(times))
        most = int(times.max())
        of_second = self.milliseconds(most)
        return {
            "median": median,
            "p99": int(np.percentile(times, 99, method="inverted_cdf")),
            "max": most,
            "min": int(times.min()),
            "spread_percent": (most - int(times.min())) / median * 100.0 if median else None,
            "median_ms": self.milliseconds(median),
            "max_ms": of_second,
            "max_share_of_second_percent": None if of_second is None else of_second / 10.0,
        }


def check_log(folder: Path, file: Path, clock_mhz: float | None = None) -> BoardResult:
    """Read a log, and drive the same inputs with the same sources on this machine.

    Parameters
    ----------
    folder : of the project whose program wrote the log
    file : the log
    clock_mhz : of the board's core, in place of that in the log

    Raises
    ------
    InputError
        If project or log cannot be used, they do not belong together, the counter stood still, or
        commands differ by more than round-off.
    CodegenError
        If there is no C compiler here, or it fails.
    """
    owner = f"--from-log {file}"
    manifest = load_manifest(folder)
    sources = load_sources(folder, manifest)
    log = read_log(file)
    if log.identity != manifest.identity:
        raise InputError(
            f"{owner}: is of another program than --project {folder}: identity {log.identity}, "
            f"{log.controller} {log.precision}, {len(log.step)} s, not {manifest.identity}, "
            f"{manifest.controller} {manifest.precision}, {manifest.seconds} s"
        )
    if (log.precision, len(log.step)) != (manifest.precision, manifest.seconds):
        raise InputError(f"{owner}: precision and seconds are not those of --project {folder}")
    if clock_mhz is not None and log.unit != "cycles":
        raise InputError(f"--clock-mhz has no effect: the log counts {log.unit}; leave it out")
    if not log.step.any():
        raise InputError(
            f"{owner}: every step took 0 {log.unit}: the counter stands still (see start_cycle_"
            "counter in replay_port.c)"
        )
    if clock_mhz is None and log.unit == "cycles" and log.hz:
        clock_mhz = log.hz / 1e6
    clock = None if clock_mhz is None else checked_mhz(clock_mhz)
    result = BoardResult(manifest, log, replayed(manifest, sources), clock)
    check_commands(result, owner)
    return result


def replayed(manifest: Manifest, sources: dict[str, str]) -> Commands:
    """Replay a project's record on this machine.

    Raises
    ------
    CodegenError
        If it cannot be compiled here.
    """
    library = loaded(compiled(sources))
    _, output = structures(manifest.precision, 1, 1, False)
    out = output()
    sizes = (ctypes.sizeof(output._fields_[0][1]), ctypes.sizeof(output))
    if (library.mpc_abi(_SIZEOF_REAL), library.mpc_abi(_SIZEOF_OUT)) != sizes:
        raise CodegenError("the project's outputs are laid out differently from this version's")
    if library.replay_begin() != 0:
        raise CodegenError("the project's trip is refused by its own controller")
    while manifest.prepared and library.replay_depart() > 0:
        pass
    rows = []
    for second in range(manifest.seconds):
        library.replay_fill(second)
        library.replay_decide(ctypes.byref(out))
        rows.append((out.p_eng_w, out.engine_on, out.rung, out.flags))
    power_w, engine_on, rung, flags = np.array(rows).T
    return Commands(power_w, engine_on == 1, rung.astype(np.int64), flags.astype(np.int64))


def check_commands(result: BoardResult, owner: str) -> None:
    """Check that round-off explains every difference; `owner` begins the message.

    Raises
    ------
    InputError
        If it does not.
    """
    log, expected = result.log, result.expected
    off = np.flatnonzero((log.rung != expected.rung) | (log.flags != expected.flags))
    if len(off):
        second = int(off[0])
        here, there = _status(expected, second), _status(log, second)
        raise InputError(
            f"{owner}: second {second}: the board says {there}, this machine {here}, of the same "
            f"inputs ({len(off)} such seconds): was it built with other flags?"
        )
    differing, seconds = result.differing, len(log.step)
    allowed = -(-seconds * TIES_A_HUNDRED[log.precision] // 100)
    if len(differing) > allowed:
        second = int(differing[0])
        raise InputError(
            f"{owner}: second {second}: the board commands {_command(log, second)}, this machine "
            f"{_command(expected, second)}: more than {result.tolerance_w:.3g} W apart in "
            f"{len(differing)} of {seconds} seconds, where {allowed} may be"
        )


def _status(commands: Commands | BoardLog, second: int) -> str:
    names = "; ".join(Flag(int(commands.flags[second])).names()) or "no flag"
    return f"rung {commands.rung[second]}, {names}"


def _command(commands: Commands | BoardLog, second: int) -> str:
    on = commands.engine_on[second]
    return f"{commands.power_w[second]:.1f} W" if on else "engine off"
