"""A generated C project in a folder, and the tools that look at it."""

import shutil
import subprocess
from importlib import resources
from pathlib import Path

import pytest

from qpmpc.codegen.generate import Algorithm, Precision, generate
from qpmpc.codegen.method import Generated, Method
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.vehicle import Vehicle, load_vehicle

# OSQP's headers, if it is the solver; their warnings are theirs.
OUTSIDE = ["-isystem", "osqp", "-isystem", "osqp/inc/public", "-Iosqp/inc/private"]
SANITIZERS = "-fsanitize=address,undefined,float-cast-overflow,float-divide-by-zero"


def need(*tools: str) -> None:
    """Skip the test unless these are installed."""
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command in the folder."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def make_project(
    folder: Path,
    precision: Precision,
    algorithm: Algorithm = "admm",
    vehicle: Vehicle | None = None,
    settings: dict[str, object] | None = None,
) -> None:
    """Write the project for this machine, and the programs that attack it."""
    chosen = ControllerSettings().with_settings(settings or {})
    name: Generated = "mh-costate" if algorithm == "costate" else "mh-qp"
    values = Method.of(name, chosen).values(vehicle or load_vehicle(), None)
    generate(values, folder, "host", precision, algorithm)
    for file in (resources.files("qpmpc.codegen") / "fuzz").iterdir():
        (folder / file.name).write_text(file.read_text("utf-8"))


def sources(folder: Path) -> list[str]:
    """Our own files of the controller."""
    return sorted(p.name for p in folder.glob("mpc_*.c"))


def build(folder: Path, compiler: str, flags: str, program: str, *own: str) -> None:
    """Compile a program from its own files, the controller and OSQP, if it is the solver.

    `own` may begin with more flags. The objects of controller and OSQP are kept for the next
    program with the same flags. OSQP divides by a residual of zero, for a figure that it only
    reports.
    """
    osqp = sorted(str(p.relative_to(folder)) for p in folder.glob("osqp/**/*.c"))
    kind = abs(hash((compiler, flags)))
    objects = {name: f"{Path(name).stem}-{kind}.o" for name in (*sources(folder), *osqp)}
    for name, made in objects.items():
        if not (folder / made).exists():
            theirs = ["-w", "-fno-sanitize=float-divide-by-zero"] if name in osqp else []
            also = [*theirs, "-c", "-o", made, name]
            built = run(folder, compiler, *flags.split(), *OUTSIDE, *also)
            assert built.returncode == 0, built.stderr
    files = [*own, *objects.values(), "-lm"]
    built = run(folder, compiler, *flags.split(), *OUTSIDE, "-o", program, *files)
    if built.returncode and "clang_rt" in built.stderr:
        pytest.skip("not installed: clang's run-time library (libclang-rt-dev)")
    assert built.returncode == 0, built.stderr
