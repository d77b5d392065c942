"""The generated controller as a shared library of this machine, built once and kept."""

import ctypes
from _ctypes import dlclose, dlsym
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any
from weakref import finalize

from qpmpc.codegen.c_compiler import (
    DATA,
    FLAGS,
    RELOCATABLE,
    CodegenError,
    common_object,
    library_of,
)
from qpmpc.codegen.examples import is_example
from qpmpc.codegen.generate import Algorithm, Precision, one_of, project_files
from qpmpc.codegen.kept_library import kept_library, key_of
from qpmpc.codegen.library_cache import Kept, kept_file
from qpmpc.codegen.values import Values
from qpmpc.remarks import say_once

ABI_VERSION = 8
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
    "offset of calibration",
    "MPC_CAL_ENTRIES",
)
_STATE, _CALIBRATION = 4, 12
_RETURNS_INT = ctypes.CFUNCTYPE(ctypes.c_int32)
# Before mpc_step.c in a library whose solver fails where it is told to.
MAY_FAIL = """#include <stdint.h>
int32_t mpc_solver_may_succeed = 1;
#define MPC_SOLVER_MAY_SUCCEED mpc_solver_may_succeed
"""
_WITHOUT_OBJECTS: set[str] = set()  # compilers that could not make or link one


@cache
def structures(precision: Precision, short: int, long: int, learning: bool) -> tuple[Any, Any]:
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
            ("long_must_share", real * long),
            ("long_free_net_w", real * long),
            ("long_free_internal_off_w", real * long),
            ("long_rises", real * long),
            ("long_fall_j", real * long),
            ("long_rise_j", real * long),
            ("short_rise_j", real),
            ("short_count", ctypes.c_int32),
            ("second", ctypes.c_int32),
            ("engine_on", ctypes.c_int32),
            *([("fuel_g", real)] if learning else []),
        ]

    class MpcOut(ctypes.Structure):
        _fields_ = [
            ("p_eng_w", real),
            ("on_share", real),
            ("relaxation_gap", real),  # of the costate method certificate_g
            ("engine_on", ctypes.c_int32),
            ("rung", ctypes.c_int32),
            ("flags", ctypes.c_int32),
            ("iterations", ctypes.c_int32),
            ("wrong_entry", ctypes.c_int32),
        ]

    return MpcIn, MpcOut


def loaded(file: Path) -> ctypes.CDLL:
    """Load a library, to be closed when neither it nor any of its functions is in use.

    Raises
    ------
    OSError
        If it cannot be loaded.
    """
    library = ctypes.CDLL(str(file))
    closing = finalize(library, dlclose, library._handle)
    closing.atexit = False  # then the process ends, and what is left may still call into it
    return library


def _function(library: ctypes.CDLL, name: str) -> Any:
    """Return a function, which keeps its library from being closed.

    Those that ctypes makes refer to themselves: they would go, and the library with them, only
    when garbage is collected.
    """
    function = _RETURNS_INT(dlsym(library._handle, name))
    function.library = library  # type: ignore[attr-defined]
    return function


class HostLibrary:
    """A loaded library, its layout checked; closed when it is no longer used.

    Attributes
    ----------
    input_type, output_type : ctypes structures
    state_bytes : size of one controller's memory
    functions : of the library, by their names in C
    remark : what a user should know about where it is kept, in one line; may be empty
    solver_may_succeed : 0 lets the solver fail, for all controllers of this library; None if it
        was not built for that

    Raises
    ------
    CodegenError
        If it cannot be loaded or does not fit.
    """

    def __init__(
        self,
        file: Path,
        values: Values,
        precision: Precision,
        prefix: str = "",
        remark: str = "",
    ) -> None:
        sizes = values.sizes
        self.values, self.precision, self.remark = values, precision, remark
        self.real = ctypes.c_float if precision == "f32" else ctypes.c_double
        self.input_type, self.output_type = structures(
            precision, sizes.short_stages, sizes.long_stages, values.learning
        )
        try:
            self.functions = loaded(file)
            abi, self.init, self.depart, self.step, self.plan = (
                _function(self.functions, f"{prefix}mpc_{name}")
                for name in ("abi", "init", "depart", "step", "plan")
            )
        except OSError as error:
            raise CodegenError(f"{file} cannot be loaded: {error}") from error
        found = [abi(i) for i in range(len(_ABI_NAMES))]
        self.state_bytes, self._calibration_at = found[_STATE], found[_CALIBRATION]
        expected = [
            ABI_VERSION,
            ctypes.sizeof(self.real),
            ctypes.sizeof(self.input_type),
            ctypes.sizeof(self.output_type),
            self.state_bytes,
            sizes.short_stages,
            sizes.long_stages,
            values.variables,
            values.row_count,
            values.iterations,
            self.input_type.short_count.offset,
            self.output_type.engine_on.offset,
            self._calibration_at,
            len(values.calibration.names),
        ]
        for name, have, want in zip(_ABI_NAMES, found, expected, strict=True):
            if have != want:
                raise CodegenError(f"{file}: {name} is {have}, expected {want}")
        self.solver_may_succeed: ctypes.c_int32 | None = None

    def calibrate(self, state: ctypes.Array[ctypes.c_char], numbers: Mapping[str, float]) -> None:
        """Write numbers into the calibration of a state, as a tool does; the next step checks them.

        Raises
        ------
        InputError
            If there is no such number.
        """
        names = self.values.calibration.names
        page = (self.real * len(names)).from_buffer(state, self._calibration_at)
        for name, number in numbers.items():
            page[names.index(one_of(name, names, "number of the calibration"))] = number


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
        If there is no compiler, or it fails, or its library cannot be loaded.
    """
    files = project_files(values, "host", precision, algorithm)
    if may_fail:
        files["mpc_step.c"] = MAY_FAIL + files["mpc_step.c"]
    kept = _kept(files)
    library = HostLibrary(kept.file, values, precision, remark=kept.remark)
    if may_fail:
        # in the library's memory: good as long as that is loaded
        switch = ctypes.c_int32.in_dll(library.functions, "mpc_solver_may_succeed")
        library.solver_may_succeed = switch
    return library


def compiled(files: Mapping[str, str]) -> Path:
    """Compile the files of a project, by name, into a library kept by its contents.

    Raises
    ------
    CodegenError
        If there is no compiler, or it fails.
    """
    return _kept(files).file


def _kept(files: Mapping[str, str]) -> Kept:
    sources = {n: t for n, t in files.items() if n.endswith((".c", ".h")) and not is_example(n)}
    return kept_library(sources, FLAGS, lambda *made_with: _built(sources, *made_with))


def _built(files: Mapping[str, str], command: str, identity: str) -> bytes:
    """Return the content of a library, made from the object of all but its numbers if possible."""
    if DATA not in files or identity in _WITHOUT_OBJECTS:
        return library_of(command, files)
    others = {name: text for name, text in files.items() if name != DATA}
    key = key_of(f"{identity} {RELOCATABLE}", others)
    try:
        common = kept_file(key, ".o", lambda: common_object(command, others))
        return library_of(command, files, common.file)
    except CodegenError:
        content = library_of(command, files)  # fails as well if the fault is in the sources
        _WITHOUT_OBJECTS.add(identity)
        say_once(f"{command} cannot link an object: each new vehicle is compiled in full, 1 to 2 s")
        return content
