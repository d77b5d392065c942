"""C for a cvxpy planner's program, with the user's terms, by cvxpygen; and a planner driven by it.

cvxpygen writes C that turns the program's parameters into the data of a solver, and the solver
with it. `program.c` beside it has one function: all parameters in, the plan out. The same files
are compiled here and on a target.
"""

import ctypes
import hashlib
import io
import platform
import subprocess
import tempfile
from contextlib import redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.c_compiler import CodegenError, compiler
from qpmpc.codegen.library_cache import kept_file
from qpmpc.controllers.cvxpy_planner import CvxpyPlanner
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import InputError
from qpmpc.files import write_text
from qpmpc.qp.cvxpy_twin import UNIT
from qpmpc.trip import Trip

EXTRA = "pip install 'qpmpc-iptm[prototype]'"
SOLVER = "QOCO"  # C without dependencies; OSQP does not converge on this program from cold
SOLVED = (1, 2)  # QOCO's codes: solved, solved inaccurately, as cvxpy's two of an optimum
FOLDERS = ("include", "solver_code", *(f"solver_code/{sub}" for sub in
           ("include", "algebra", "lib/amd", "lib/qdldl/include")))  # fmt: skip
FLAGS = ["-O2", "-std=gnu99", "-w", "-fPIC", *(f"-I{folder}" for folder in FOLDERS)]

PROGRAM_H = """/* The program of one second: all parameters in, the plan out. */
#ifndef PROGRAM_H
#define PROGRAM_H
#define PROGRAM_PARAMETERS {parameters}
#define PROGRAM_STAGES {stages}
#define PROGRAM_VARIABLES {variables}
/* Returns QOCO's status, 1 or 2 with a plan. Variable by variable, in units of the table below:
{table} */
int program_solve(const double *given, double *plan, int *iterations);
#endif
"""

PROGRAM_C = """#include "program.h"
#include "cpg_solve.h"
#include "cpg_workspace.h"

int program_solve(const double *given, double *plan, int *iterations)
{{
    int i;
{updates}
    if (qoco_solver != NULL) {{
        /* a second solution with the same solver is wrong in QOCO as cvxpygen 1.0.2 ships it */
        qoco_cleanup(qoco_solver);
        qoco_solver = NULL;
    }}
    cpg_solve();
{copies}
    *iterations = (int)CPG_Result.info->iter;
    return (int)CPG_Result.info->status;
}}
"""

# What the CMake of QOCO and QDLDL would write, for a compiler alone.
CONFIGURED = {
    "solver_code/include/qoco_config.h": """#ifndef QOCO_CONFIG_H
#define QOCO_CONFIG_H
#ifdef __APPLE__
#define IS_MACOS
#else
#define IS_LINUX
#endif
#define QOCO_VERSION_MAJOR 0 /* printed in its header alone */
#define QOCO_VERSION_MINOR 0
#define QOCO_VERSION_PATCH 0
#endif
""",
    "solver_code/lib/qdldl/include/qdldl_types.h": """#ifndef QDLDL_TYPES_H
#define QDLDL_TYPES_H
#include <limits.h>
typedef int QDLDL_int;
typedef double QDLDL_float;
typedef unsigned char QDLDL_bool;
#define QDLDL_INT_MAX INT_MAX
#endif
""",
    "solver_code/lib/qdldl/include/qdldl_version.h": "/* of cvxpygen */\n",
}

# The solver is set up anew each second (see PROGRAM_C), so what it is set up from must not stay
# allocated. It is copied, and needed in that block alone.
CORRECTED = {
    "(QOCOCscMatrix*)malloc(sizeof(QOCOCscMatrix))": "&(QOCOCscMatrix){0}",
    "(QOCOSettings*)malloc(sizeof(QOCOSettings))": "&(QOCOSettings){0}",
}

MAKEFILE = """# libprogram.a: the program of one second. C99 with the timers of POSIX.
CFLAGS ?= -O2 -std=gnu99
INCLUDE := {include}
SOURCES := {sources}
libprogram.a: $(SOURCES:.c=.o)
\t$(AR) rcs $@ $^
%.o: %.c
\t$(CC) $(CFLAGS) $(INCLUDE) -c $< -o $@
clean:
\trm -f libprogram.a $(SOURCES:.c=.o)
"""


NOTICE = """src and include were written by cvxpygen (Apache-2.0) from a program of qpmpc (same);
allocations in cpg_solve.c are changed. solver_code is QOCO (BSD-3-Clause) with QDLDL (Apache-2.0)
and AMD (BSD-3-Clause), as cvxpygen has them; qoco_config.h, qdldl_types.h and qdldl_version.h are
the product's own.
"""


def program_files(planner: CvxpyPlanner) -> dict[str, str]:
    """Generate the C of a planner's program.

    Parameters
    ----------
    planner : made for a trip; the program's sizes, constants and first parameters are its

    Returns
    -------
    text of each file, by its name in the project's folder

    Raises
    ------
    InputError
        If cvxpygen is not installed.
    CodegenError
        If it cannot generate code for this program.
    """
    if find_spec("cvxpygen") is None:
        raise InputError(f"C for a cvxpy program needs cvxpygen, which is not installed: {EXTRA}")
    from cvxpygen import cpg

    planner.set_program(planner.trip.start)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "code"
        try:
            with redirect_stdout(io.StringIO()):
                cpg.generate_code(
                    planner.program.problem, code_dir=str(folder), solver=SOLVER, wrapper=False
                )
        except Exception as error:  # it raises many kinds
            said = " ".join(str(error).split()) or type(error).__name__
            raise CodegenError(f"{planner.name}: cvxpygen: {said}") from error
        made = folder / "c"
        files = {
            str(file.relative_to(made)): _mended(file.read_text("utf-8"))
            for file in sorted(made.rglob("*"))
            if file.suffix in (".c", ".h") or file.name == "LICENSE"
        }
    for name in [name for name in files if "cpg_example" in name or _of_other_system(name)]:
        del files[name]
    return files | _own_files(planner, files)


def _mended(text: str) -> str:
    """Correct what is wrong, and leave out the date, so that equal programs have equal files."""
    for wrong, right in CORRECTED.items():
        text = text.replace(wrong, right)
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("Auto-generated by CVXPYgen on"))


def _of_other_system(name: str) -> bool:
    own = "macos" if platform.system() == "Darwin" else "linux"
    return "timer_" in name and name.endswith(".c") and own not in name


def _own_files(planner: CvxpyPlanner, others: dict[str, str]) -> dict[str, str]:
    program = planner.program
    parameters = program.problem.parameters()
    names = {var: variable.name() for var, variable in program.variables.items()}
    updates = [
        f"    for (i = 0; i < {one.size}; i++) {{ cpg_update_{one.name()}(i, *given++); }}"
        if one.ndim
        else f"    cpg_update_{one.name()}(*given++);"
        for one in parameters
    ]
    copies = [
        f"    for (i = 0; i < {program.stages}; i++) {{ *plan++ = CPG_Result.prim->{name}[i]; }}"
        for name in names.values()
    ]
    header = PROGRAM_H.format(
        parameters=sum(one.size for one in parameters),
        stages=program.stages,
        variables=len(names),
        table="\n".join(f"   {name}: {UNIT[var]:g} in SI" for var, name in names.items()),
    )
    source = PROGRAM_C.format(updates="\n".join(updates), copies="\n".join(copies))
    sources = ["program.c", *(name for name in others if name.endswith(".c"))]
    makefile = MAKEFILE.format(
        include=" ".join(f"-I{folder}" for folder in FOLDERS), sources=" ".join(sources)
    )
    return {
        "program.h": header,
        "program.c": source,
        "Makefile": makefile,
        "NOTICE": NOTICE,
        **CONFIGURED,
    }


def write_c(planner: CvxpyPlanner, folder: str | Path) -> Path:
    """Write the C project of a planner's program; returns its folder.

    Raises
    ------
    InputError, CodegenError
        As of `program_files`; or if a file cannot be written.
    """
    files = program_files(planner)
    for name, text in files.items():
        write_text(Path(folder) / name, text)
    return Path(folder)


def _library(files: dict[str, str]) -> Path:
    """Compile the files into a library, kept by its contents."""
    command = compiler()
    if command is None:
        raise CodegenError("no C compiler found (tried $CC, cc, gcc, clang)")
    identity = f"{command} {FLAGS} {platform.machine()} {sorted(files.items())}"
    key = hashlib.sha256(identity.encode()).hexdigest()[:24]
    return kept_file(key, ".so", lambda: _compiled(command, files)).file


def _compiled(command: str, files: dict[str, str]) -> bytes:
    with tempfile.TemporaryDirectory() as scratch:
        for name, text in files.items():
            file = Path(scratch) / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, "utf-8")
        sources = [name for name in files if name.endswith(".c")]
        arguments = [command, *FLAGS, "-shared", "-o", "made", *sources, "-lm"]
        done = subprocess.run(
            arguments, cwd=scratch, capture_output=True, text=True, errors="replace", check=False
        )
        if done.returncode:
            lines = done.stderr.strip().splitlines()
            first = next((line for line in lines if "error" in line), "no library was built")
            raise CodegenError(f"C compiler {command} failed: {first}")
        return (Path(scratch) / "made").read_bytes()


class CompiledProgram:
    """A planner's program as C on this machine.

    Parameters
    ----------
    planner : whose program it is; its parameters are read at each `solve`
    """

    def __init__(self, planner: CvxpyPlanner) -> None:
        self._name, self._program = planner.name, planner.program
        self._parameters = self._program.problem.parameters()
        self._given = np.empty(sum(one.size for one in self._parameters))
        self._plan = np.empty((len(self._program.variables), self._program.stages))
        self._unit = np.array([UNIT[var] for var in self._program.variables])
        self._iterations = ctypes.c_int()
        self._solve = ctypes.CDLL(str(_library(program_files(planner)))).program_solve

    def solve(self) -> NDArray[np.float64]:
        """Solve for the parameters as they are set; x, shape (n, variables), SI units.

        Raises
        ------
        CodegenError
            If the solver finds no optimum.
        """
        place = 0
        for one in self._parameters:
            self._given[place : place + one.size] = np.ravel(one.value, order="F")
            place += one.size
        double = ctypes.POINTER(ctypes.c_double)
        status = self._solve(
            self._given.ctypes.data_as(double),
            self._plan.ctypes.data_as(double),
            ctypes.byref(self._iterations),
        )
        if status not in SOLVED:
            raise CodegenError(f"generated program: {SOLVER} ends with status {status}")
        x: NDArray[np.float64] = self._plan.T * self._unit
        return x


def in_c(planner: type[CvxpyPlanner]) -> type[CvxpyPlanner]:
    """Return a planner as this one, named ``NAME-c``, whose program is solved by generated C.

    Generating and compiling takes some seconds when one is made. The C has its own solver: the
    class attribute `solver` has no effect on it.
    """

    class InC(planner):  # type: ignore[valid-type, misc]
        __doc__ = f"{planner.name} in generated C."
        name = f"{planner.name}-c"

        def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
            super().__init__(trip, settings)
            self.solver_name = f"cvxpygen {SOLVER.lower()}"
            self._compiled: Any = CompiledProgram(self)

        def solved(self) -> NDArray[np.float64]:
            """Solve in C."""
            found: NDArray[np.float64] = self._compiled.solve()
            return found

    return InC
