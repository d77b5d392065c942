"""Firmware for a Cortex-M7: built with the ARM tool chain, run in QEMU, driven through pipes."""

import ctypes
import os
import re
import select
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any, Self

from qpmpc.codegen.c_compiler import CodegenError
from qpmpc.codegen.generate import Algorithm, Precision, generate
from qpmpc.codegen.host_library import structures
from qpmpc.codegen.values import Values

COMPILER, SIZE, NM, QEMU = (
    "arm-none-eabi-gcc",
    "arm-none-eabi-size",
    "arm-none-eabi-nm",
    "qemu-system-arm",
)
PACKAGES = "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm make"
TIMER_HZ = 25_000_000
ICOUNT_SHIFT = 6  # 2^6 ns of the machine's time per instruction
INSTRUCTIONS_A_TICK = 1e9 / TIMER_HZ / 2**ICOUNT_SHIFT
STACK_RESERVED_BYTES = 4096  # in cortex_m7.ld
ANSWER_TIMEOUT_S = 300.0
LOOK_EVERY_S = 0.2  # whether QEMU is still running
_INIT, _DEPART, _STEP, _STOP, _SERVE = range(5)
_LINE = "line"  # pipes of the serial line: line.in, line.out


def missing_tools(names: Sequence[str] = (COMPILER, SIZE, NM, QEMU, "make")) -> list[str]:
    """Return the tools of the list that this machine does not have."""
    return [name for name in names if shutil.which(name) is None]


def require_tools() -> None:
    """Check that firmware can be built and run here.

    Raises
    ------
    CodegenError
        If a tool is missing; the message names the Debian packages.
    """
    missing = missing_tools()
    if missing:
        raise CodegenError(
            f"processor in the loop needs {', '.join(missing)}, not found here: "
            f"apt-get install {PACKAGES}"
        )


@dataclass(frozen=True)
class Footprint:
    """Memory of a firmware, bytes.

    Attributes
    ----------
    flash : code, constants and initial values, start-up and test harness included
    ram_static : variables, harness included, without stack
    state : memory of one controller, part of `ram_static`
    stack_frames : largest stack of the controller by its call graph, see `stack_of`
    """

    flash: int
    ram_static: int
    stack_frames: int


def build_firmware(
    values: Values, precision: Precision, folder: Path, algorithm: Algorithm = "admm"
) -> Path:
    """Generate and compile the firmware of a controller; returns the ELF file.

    Raises
    ------
    CodegenError
        If a tool is missing or the compiler fails, for example because it does not fit.
    """
    require_tools()
    generate(values, folder, "cortex-m7", precision, algorithm)
    return make_firmware(folder)


def make_firmware(folder: Path, *options: str) -> Path:
    """Compile a generated project, with options of make; returns the ELF file.

    Raises
    ------
    CodegenError
        If the compiler fails, for example because it does not fit.
    """
    command = ["make", "--silent", "-C", str(folder), *options]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise CodegenError(f"firmware does not build: {_first_error(result.stderr)}")
    return folder / "firmware.elf"


def footprint(elf: Path) -> Footprint:
    """Read the sizes of a firmware from its sections and stack-usage files."""
    text = _run(SIZE, "-A", str(elf))
    sections = {m[1]: int(m[2]) for m in re.finditer(r"^\.(\S+)\s+(\d+)\s", text, re.MULTILINE)}
    initial, variables = sections.get("data", 0), sections.get("bss", 0)
    return Footprint(
        flash=sections["text"] + sections.get("ARM.exidx", 0) + initial,
        ram_static=initial + variables,
        stack_frames=stack_of(elf.parent),
    )


def symbols(elf: Path) -> list[str]:
    """Return the names of all symbols of a firmware."""
    return [line.split()[-1] for line in _run(NM, str(elf)).splitlines()]


def stack_of(folder: Path) -> int:
    """Worst stack of `mpc_step`, from the compiler's frames along the deepest call chain.

    Calls are found in the disassembly; the C library's leaves (powf, memset, memcpy) have no
    stack-usage file and count as `LIBRARY_FRAME_BYTES`. A call through a pointer may lead to any
    function of OSQP's linear solver: nothing else is called that way.
    """
    frames: dict[str, int] = {}
    for file in folder.rglob("*.su"):
        for line in file.read_text("utf-8").splitlines():
            place, size, kind = line.split("\t")
            if "dynamic" in kind:
                raise CodegenError(f"stack of {place} is not bounded")
            frames[place.rsplit(":", 1)[-1]] = int(size)
    calls = _calls(folder / "firmware.elf")

    def depth(function: str, above: tuple[str, ...]) -> int:
        if function in above:
            raise CodegenError(f"{function} is recursive")
        inner = [depth(name, (*above, function)) for name in calls.get(function, ())]
        return frames.get(function, LIBRARY_FRAME_BYTES) + max(inner, default=0)

    return max(depth("mpc_step", ()), depth("mpc_depart", ()))


LIBRARY_FRAME_BYTES = 64


def _calls(elf: Path) -> dict[str, set[str]]:
    """Direct calls and tail calls of each function."""
    calls: dict[str, set[str]] = {}
    through_pointer: set[str] = set()
    here = ""
    for line in _run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", str(elf)).splitlines():
        head = re.match(r"^[0-9a-f]+ <(\w+)>:$", line)
        if head:
            here = head[1]
            calls[here] = set()
            continue
        call = re.search(r"\t(?:bl?(?:\.[nw])?)\s+[0-9a-f]+ <(\w+)>$", line)
        if call and call[1] != here:
            calls[here].add(call[1])
        elif re.search(r"\t(?:blx|bx)\s+(?!lr)\w+$", line):
            through_pointer.add(here)
    for name in through_pointer:
        calls[name] |= {target for target in calls if target.endswith("_qdldl")}
    return calls


@dataclass(frozen=True)
class Answer:
    """The target's answer to one request.

    Attributes
    ----------
    result : of the function called
    instructions : taken by it, measured on the target
    stack_bytes : most stack ever used, painted on the target
    state_bytes : memory of one controller
    out : the `mpc_out` structure
    """

    result: int
    instructions: int
    stack_bytes: int
    state_bytes: int
    out: Any


class Target:
    """A running firmware; use it as a context manager.

    Parameters
    ----------
    elf : firmware
    values, precision : that it was generated from
    folder : for the pipes; QEMU runs in it
    has_line : whether it was built with XCP=1, and serves a calibration tool at its serial line
    """

    def __init__(
        self,
        elf: Path,
        values: Values,
        precision: Precision,
        folder: Path,
        has_line: bool = False,
    ) -> None:
        require_tools()
        sizes = values.sizes
        self.input_type, output = structures(
            precision, sizes.short_stages, sizes.long_stages, values.learning
        )

        class _Answer(ctypes.Structure):
            _fields_ = [
                ("result", ctypes.c_int32),
                ("ticks", ctypes.c_uint32),
                ("idle_ticks", ctypes.c_uint32),
                ("stack_bytes", ctypes.c_uint32),
                ("state_bytes", ctypes.c_uint32),
                ("in_bytes", ctypes.c_uint32),
                ("out_bytes", ctypes.c_uint32),
                ("padding", ctypes.c_uint32),
                ("out", output),
            ]

        self._answer_type = _Answer
        self._in_bytes, self._out_bytes = ctypes.sizeof(self.input_type), ctypes.sizeof(output)
        lines = (f"{_LINE}.in", f"{_LINE}.out") if has_line else ()
        for name in ("request", "answer", *lines):
            (folder / name).unlink(missing_ok=True)
            os.mkfifo(folder / name)
        serial = f"pipe:{_LINE}" if has_line else "none"
        machine = f"-M mps2-an500 -nographic -monitor none -serial {serial}"
        self._process = subprocess.Popen(
            [
                QEMU,
                *machine.split(),
                *("-semihosting-config", "enable=on,target=native"),
                *("-icount", f"shift={ICOUNT_SHIFT},sleep=off"),
                *("-kernel", str(elf.resolve())),
            ],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        # Opening for both ways never blocks, even if QEMU fails to start.
        self._requests = os.open(folder / "request", os.O_RDWR)
        self._answers = os.open(folder / "answer", os.O_RDWR)
        self._line = [os.open(folder / name, os.O_RDWR) for name in lines]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop firmware and QEMU."""
        if self._process.poll() is None:
            os.write(self._requests, _STOP.to_bytes(4, "little"))
            try:
                self._process.wait(timeout=5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        for descriptor in (self._requests, self._answers, *self._line):
            os.close(descriptor)
        self._requests = self._answers = -1

    def init(self) -> Answer:
        """Call mpc_init."""
        return self._ask(_INIT, self.input_type())

    def depart(self, inputs: Any) -> Answer:
        """Call mpc_depart once."""
        return self._ask(_DEPART, inputs)

    def step(self, inputs: Any) -> Answer:
        """Call mpc_step."""
        return self._ask(_STEP, inputs)

    def exchange(self, frame: bytes) -> bytes:
        """Let the firmware take a command from its serial line; returns what it has sent there."""
        to_target, from_target = self._line
        os.write(to_target, frame)
        self._ask(_SERVE, self.input_type())
        ready, _, _ = select.select([from_target], [], [], LOOK_EVERY_S)
        return os.read(from_target, 4096) if ready else b""

    def _ask(self, command: int, inputs: Any) -> Answer:
        os.write(self._requests, command.to_bytes(4, "little") + bytes(inputs))
        answer = self._answer_type.from_buffer_copy(self._read(ctypes.sizeof(self._answer_type)))
        if (answer.in_bytes, answer.out_bytes) != (self._in_bytes, self._out_bytes):
            raise CodegenError("the firmware's inputs or outputs are laid out differently")
        return Answer(
            answer.result,
            round((answer.ticks - answer.idle_ticks) * INSTRUCTIONS_A_TICK),
            answer.stack_bytes,
            answer.state_bytes,
            answer.out,
        )

    def _read(self, size: int) -> bytes:
        data, give_up = b"", monotonic() + ANSWER_TIMEOUT_S
        while len(data) < size:
            ready, _, _ = select.select([self._answers], [], [], LOOK_EVERY_S)
            if ready:
                data += os.read(self._answers, size - len(data))
            elif self._process.poll() is not None:
                raise CodegenError(f"the firmware has stopped (exit {self._process.returncode})")
            elif monotonic() > give_up:
                raise CodegenError(f"the firmware does not answer within {ANSWER_TIMEOUT_S:g} s")
        return data


def _run(*command: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise CodegenError(f"{command[0]} failed: {_first_error(result.stderr)}")
    return result.stdout


def _first_error(text: str) -> str:
    lines = [line for line in text.splitlines() if "error" in line.lower()] or text.splitlines()
    return lines[0].strip() if lines else "no message"
