"""The generated controller as a shared library of this machine, built once and kept."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from qpmpc.codegen.examples import is_example
from qpmpc.codegen.generate import Algorithm, Precision, project_files
from qpmpc.codegen.values import Values
from qpmpc.errors import QpmpcError
from qpmpc.files import write_text
from qpmpc.qp.rows import VARS

ABI_VERSION = 3
_ABI_NAMES = (
    "version",
    "sizeof mpc_real",
    "sizeof mpc_in",
    "sizeof mpc_out",
    "sizeof mpc_state",
    "MPC_SHORT",
    "MPC_LONG",
    "MPC_VARS",
    "MPC_ROWS",
    "MPC_ITERATIONS",
    "offset of short_count",
    "offset of engine_on",
)
# -w: a new compiler's warnings must not stop a user; the tests check warnings
FLAGS = (
    "-O3 -std=c99 -w -ffp-contract=off -fPIC -shared -Wl,-Bsymbolic "
    "-Iosqp -Iosqp/inc/public -Iosqp/inc/private"
)
_STATE = 4
# Before mpc_step.c in a library whose solver fails where it is told to.
MAY_FAIL = """#include <stdint.h>
int32_t mpc_solver_may_succeed = 1;
#define MPC_SOLVER_MAY_SUCCEED mpc_solver_may_succeed
"""


class CodegenError(QpmpcError):
    """A generated controller could not be built or does not fit its caller."""


def compiler() -> str | None:
    """Return the C compiler of this machine: $CC, cc, gcc or clang; None if there is none."""
    names = [os.environ.get("CC", ""), "cc", "gcc", "clang"]
    return next((found for name in names if name and (found := shutil.which(name))), None)


@cache
def structures(precision: Precision, short: int, long: int) -> tuple[Any, Any]:
    """Return the ctypes twins of `mpc_in` and `mpc_out`."""
    real = ctypes.c_float if precision == "f32" else ctypes.c_double

    class MpcIn(ctypes.Structure):
        _fields_ = [
            ("soc", real),
            ("t_cl_degc", real),
            ("demand_w", real),
            ("speed_mps", real),
            ("short_demand_w", real * short),
            ("short_speed_mps", real * short),
            ("long_duration_s", real * long),
            ("long_net_w", real * long),
            ("long_speed_mps", real * long),
            ("long_internal_off_w", real * long),
            ("short_count", ctypes.c_int32),
            ("second", ctypes.c_int32),
            ("engine_on", ctypes.c_int32),
        ]

    class MpcOut(ctypes.Structure):
        _fields_ = [
            ("p_eng_w", real),
            ("on_share", real),
            ("relaxation_gap", real),
            ("engine_on", ctypes.c_int32),
            ("rung", ctypes.c_int32),
            ("flags", ctypes.c_int32),
            ("iterations", ctypes.c_int32),
        ]

    return MpcIn, MpcOut


class HostLibrary:
    """A loaded library, its layout checked.

    Attributes
    ----------
    input_type, output_type : ctypes structures
    state_bytes : size of one controller's memory
    functions : of the library, by their names in C
    solver_may_succeed : 0 lets the solver fail, for all controllers of this library; None if it
        was not built for that
    """

    def __init__(self, file: Path, values: Values, precision: Precision, prefix: str = "") -> None:
        sizes = values.sizes
        self.values, self.precision = values, precision
        self.real = ctypes.c_float if precision == "f32" else ctypes.c_double
        self.input_type, self.output_type = structures(
            precision, sizes.short_stages, sizes.long_stages
        )
        self.functions = ctypes.CDLL(str(file))
        abi = getattr(self.functions, f"{prefix}mpc_abi")
        found = [abi(i) for i in range(len(_ABI_NAMES))]
        self.state_bytes = found[_STATE]
        expected = [
            ABI_VERSION,
            ctypes.sizeof(self.real),
            ctypes.sizeof(self.input_type),
            ctypes.sizeof(self.output_type),
            self.state_bytes,
            sizes.short_stages,
            sizes.long_stages,
            VARS,
            sizes.rows,
            values.iterations,
            self.input_type.short_count.offset,
            self.output_type.engine_on.offset,
        ]
        for name, have, want in zip(_ABI_NAMES, found, expected, strict=True):
            if have != want:
                raise CodegenError(f"{file}: {name} is {have}, expected {want}")
        self.init = getattr(self.functions, f"{prefix}mpc_init")
        self.depart = getattr(self.functions, f"{prefix}mpc_depart")
        self.step = getattr(self.functions, f"{prefix}mpc_step")
        self.plan = getattr(self.functions, f"{prefix}mpc_plan")
        self.solver_may_succeed: ctypes.c_int32 | None = None


def build_host_library(
    values: Values,
    precision: Precision = "f64",
    algorithm: Algorithm = "admm",
    *,
    may_fail: bool = False,
) -> HostLibrary:
    """Generate, compile and load a controller.

    Parameters
    ----------
    may_fail : with a switch that lets its solver fail, for the injection of faults

    Raises
    ------
    CodegenError
        If there is no compiler, or it fails.
    """
    files = project_files(values, "host", precision, algorithm)
    if not may_fail:
        return HostLibrary(compiled(files), values, precision)
    files["mpc_step.c"] = MAY_FAIL + files["mpc_step.c"]
    library = HostLibrary(compiled(files), values, precision)
    switch = ctypes.c_int32.in_dll(library.functions, "mpc_solver_may_succeed")
    library.solver_may_succeed = switch
    return library


def compiled(files: Mapping[str, str]) -> Path:
    """Compile the files of a project, by name, into a library kept in the cache by its contents.

    Raises
    ------
    CodegenError
        If there is no compiler, or it fails.
    """
    command = compiler()
    if command is None:
        raise CodegenError("no C compiler found (tried $CC, cc, gcc, clang)")
    digest = hashlib.sha256(f"{command} {FLAGS}".encode())
    for name, text in files.items():
        digest.update(f"{name}\0{text}\0".encode())
    kept = _cache_folder() / f"{digest.hexdigest()[:24]}.so"
    if not _loads(kept):
        _build(files, command, kept)
    return kept


def _loads(file: Path) -> bool:
    """Whether the file is there and whole."""
    if not file.exists():
        return False
    try:
        ctypes.CDLL(str(file))
    except OSError:
        return False
    return True


def _cache_folder() -> Path:
    chosen = os.environ.get("QPMPC_CACHE_DIR")
    if chosen:
        folder = Path(chosen) / "compiled"
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "qpmpc-iptm"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    folder = Path(tempfile.gettempdir()) / f"qpmpc-iptm-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def _build(files: Mapping[str, str], command: str, kept: Path) -> None:
    with tempfile.TemporaryDirectory(dir=kept.parent) as scratch:
        folder = Path(scratch)
        for name, text in files.items():
            write_text(folder / name, text)
        sources = sorted(n for n in files if n.endswith(".c") and not is_example(n))
        result = subprocess.run(
            [command, *FLAGS.split(), "-o", "libmpc.so", *sources, "-lm"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        made = folder / "libmpc.so"
        if result.returncode or not _loads(made):
            first = next(iter(result.stderr.strip().splitlines()), "no library was built")
            raise CodegenError(
                f"C compiler {command} failed: {first}; mh_qp.implementation=python needs none"
            )
        made.replace(kept)
