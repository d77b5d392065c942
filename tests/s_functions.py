"""Generated S-functions compiled against the stub of Simulink's header, driven as Simulink does."""

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.c_compiler import made_by
from qpmpc.codegen.kept_library import kept_library
from qpmpc.codegen.parts.part import Part
from qpmpc.codegen.simulink.export import s_function_files

STUB = Path(__file__).parent / "simulink" / "stub"
STRICT = (
    *("-O1", "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion"),
    *("-Werror", "-ffp-contract=off", "-fPIC", "-I."),
)
AS_MEX = "-DMATLAB_MEX_FILE"
SIDES = ("input", "output")
ALIKE = ("width", "type", "feedthrough")
SIMULINK_TYPES = {0: "double", 1: "single", 6: "int32", 8: "boolean"}


class MxArray(ctypes.Structure):
    """The stub's twin of a parameter."""

    _fields_ = [
        ("is_double", ctypes.c_int),
        ("is_complex", ctypes.c_int),
        ("count", ctypes.c_size_t),
        ("first", ctypes.c_double),
    ]


def number(value: float) -> MxArray:
    """Return a parameter that is one real number."""
    return MxArray(1, 0, 1, value)


def library_of(part: Part, name: str) -> ctypes.CDLL:
    """Return an S-function, compiled without a warning, once, and kept."""
    files = s_function_files(part, name) | {
        path.name: path.read_text("utf-8") for path in STUB.iterdir()
    }
    sources = sorted(n for n in files if n.endswith(".c") and n != "simulink.c")
    files = {n: t for n, t in files.items() if n.endswith((".c", ".h"))}
    stub = files.pop("simulink.c")
    files["simulink.c.h"] = stub  # included, not compiled
    files[f"{name}.c"] = files[f"{name}.c"].replace('"simulink.c"', '"simulink.c.h"')
    flags = [*STRICT, AS_MEX, "-shared"]
    kept = kept_library(
        files,
        " ".join(flags),
        lambda command, _: made_by(command, files, [*flags, *sources, "-lm"]),
    )
    return loaded(kept.file)


def loaded(file: Path) -> ctypes.CDLL:
    """Load a compiled S-function."""
    library = ctypes.CDLL(str(file))
    for function in ("stub_get", "stub_sample_time_s"):
        getattr(library, function).restype = ctypes.c_double
    for function in ("stub_error", "stub_warning"):
        getattr(library, function).restype = ctypes.c_char_p
    for function in ("stub_block", "stub_memory"):
        getattr(library, function).restype = ctypes.c_void_p
    return library


class Block:
    """One block of a model.

    Attributes
    ----------
    part : that it holds
    """

    def __init__(self, library: ctypes.CDLL, part: Part, *parameters: MxArray) -> None:
        self.part, self._library = part, library
        self._parameters = (MxArray * max(len(parameters), 1))(*parameters)
        self._block = ctypes.c_void_p(library.stub_block(self._parameters, len(parameters)))
        self._port = {
            variable.name: place
            for side in SIDES
            for place, variable in enumerate(v for v in part.variables if v.role == side)
        }

    def __enter__(self) -> "Block":
        return self

    def __exit__(self, *_: object) -> None:
        self._library.stub_end(self._block)

    def start(self) -> "Block":
        """Begin a simulation."""
        self._library.stub_start(self._block)
        return self

    def outputs(self, at_s: float) -> None:
        """Let outputs follow."""
        self._library.stub_outputs(self._block, ctypes.c_double(at_s))

    def update(self, at_s: float) -> None:
        """End the step."""
        self._library.stub_update(self._block, ctypes.c_double(at_s))

    def set(self, **values: float) -> None:
        """Set inputs by name."""
        for name, value in values.items():
            self._library.stub_set(self._block, self._port[name], ctypes.c_double(value))

    def get(self, *names: str) -> list[float]:
        """Return outputs by name."""
        return [self._library.stub_get(self._block, self._port[name]) for name in names]

    def memory(self) -> NDArray[np.uint64]:
        """Return the block's work vector itself, as words."""
        words = self._library.stub_words(self._block)
        kind = ctypes.POINTER(ctypes.c_uint64)
        return np.ctypeslib.as_array(
            ctypes.cast(self._library.stub_memory(self._block), kind), (words,)
        )

    def about(self, side: str) -> list[dict[str, Any]]:
        """Return width, type and feedthrough of all ports of a side, in order."""
        found: list[dict[str, Any]] = []
        while self._about(side, len(found), 0) >= 0:
            found.append({a: self._about(side, len(found), i) for i, a in enumerate(ALIKE)})
        return [of | {"type": SIMULINK_TYPES[of["type"]]} for of in found]

    def _about(self, side: str, port: int, what: int) -> int:
        return int(self._library.stub_about(self._block, SIDES.index(side), port, what))

    @property
    def error(self) -> str | None:
        """What the block reported with ssSetErrorStatus."""
        return _text(self._library.stub_error(self._block))

    @property
    def warning(self) -> str | None:
        """What the block reported with ssWarning."""
        return _text(self._library.stub_warning(self._block))

    @property
    def stops(self) -> bool:
        """Whether it asked for the end of the simulation."""
        return bool(self._library.stub_stop_requested(self._block))

    @property
    def sample_time_s(self) -> float:
        """Of the block; -1 with an offset."""
        return float(self._library.stub_sample_time_s(self._block))


def _text(found: bytes | None) -> str | None:
    return None if found is None else found.decode()
